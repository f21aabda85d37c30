"""--help and --print-config: every setting explained, in any terminal."""

import os
import re
import subprocess
import sys
import time

import pytest
from commands import ROOT, TINY, eval_script, export_script, run, train_script

from attjax import streams
from attjax.config import fields, help_text, presets, settings, toml
from attjax.config import run as run_config

SCRIPTS = {"train.py": train_script, "eval.py": eval_script, "export.py": export_script}
FIELDS = settings.FIELDS.values()
SYMBOLS = {
    "discount": "γ", "gae_lambda": "λ", "clip": "ε", "entropy_coefficient": "c",
    "final_entropy_coefficient": "c", "num_envs": "M", "passes": "N", "max_episode_steps": "T",
}  # fmt: skip


def help_of(script, capsys, monkeypatch, columns=80):
    monkeypatch.setenv("COLUMNS", str(columns))
    with pytest.raises(SystemExit) as exit_:
        SCRIPTS[script].main(["--help"])
    assert exit_.value.code == 0
    return capsys.readouterr().out


def entry(text, flag):
    """What the help says of a flag, in one line."""
    flat = re.sub(
        r"\s+", " ", re.search(rf"\n  {re.escape(flag)}\b.*?(?=\n  -|\n\n)", text, re.S)[0]
    )
    return flat.strip()


def flag_of(field):
    name = field.name.replace("_", "-")
    return f"--[no-]{name}" if field.type is bool else f"--{name}"


@pytest.mark.parametrize("field", FIELDS, ids=lambda field: field.name)
def test_a_setting_has_a_group_a_meaning_and_its_true_defaults(field, capsys, monkeypatch):
    text = help_of("train.py", capsys, monkeypatch)
    title = fields.GROUPS[field.metadata["group"]]
    group = text[text.index(f"\n{title}:\n") :].split("\n\n")[0]
    shown = entry(group + "\n\n", flag_of(field))
    assert len(field.metadata["help"]) > 10 and field.metadata["help"] in shown
    values = {name: preset.flat[field.name] for name, preset in presets.PRESETS.items()}
    if len(set(values.values())) == 1:
        ((_, default),) = re.findall(r"\((default): ([^)]*)\)$", shown)
        defaults = dict.fromkeys(values, default)
    else:
        parts = [part.split(": ") for part in re.search(r"\(([^()]*)\)$", shown)[1].split("; ")]
        defaults = {name: value for names, value in parts for name in names.split(", ")}
    assert {name: parsed(field, value) for name, value in defaults.items()} == values


def parsed(field, text):
    if field.type is bool:
        return {"yes": True, "no": False}[text]
    if field.type == tuple[int, ...]:
        return tuple(map(int, text.split(",")))
    return field.type(text)


def test_symbols_and_units_are_shown(capsys, monkeypatch):
    text = help_of("train.py", capsys, monkeypatch)
    assert {f.name: f.metadata["symbol"] for f in FIELDS if f.metadata["symbol"]} == SYMBOLS
    for field in FIELDS:
        symbol, unit = field.metadata["symbol"], field.metadata["unit"]
        shown = entry(text, flag_of(field))
        assert not symbol or f" {symbol}: " in shown
        assert not unit or f" [{unit}] " in shown
    assert "[s]" in entry(text, "--discount-period") and "[s]" in entry(text, "--save-every")


@pytest.mark.parametrize("columns", [80, 100, 200])
@pytest.mark.parametrize("script", SCRIPTS)
def test_it_fits_and_ends_with_examples_that_are_accepted(script, columns, capsys, monkeypatch):
    text = help_of(script, capsys, monkeypatch, columns)
    assert max(map(len, text.splitlines())) <= min(columns, 100)
    examples = re.findall(rf"^  python {re.escape(script)}((?: \S+)*)", text, re.M)
    assert len(examples) >= 2
    for example in examples:
        SCRIPTS[script].parse_arguments(re.split(" [>|] ", example)[0].split())


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252"])
def test_it_prints_in_any_encoding(script, encoding):
    done = run(script, "--help", env=os.environ | {"PYTHONIOENCODING": encoding})
    assert done.returncode == 0 and done.stderr == "" and "usage" in done.stdout
    if script == "train.py":
        assert "gamma: discount of later rewards" in done.stdout and "?" not in done.stdout


def test_training_and_evaluating_print_in_ascii(tmp_path):
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    total = ["--total-steps", "16384", "--near-goal-share", "0", "--no-stagger-episodes"]
    folder = ["--checkpoint", tmp_path / "run", "--max-episode-steps", "20"]
    done = run("train.py", *TINY, *total, *folder, env=environment)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert "deg  entropy" in done.stdout
    few = ["--device", "cpu", "--episodes", "2", "--duration", "1"]
    done = run("eval.py", *few, *folder[:2], env=environment)
    assert done.returncode == 0 and "phi (deg)" in done.stdout, done.stderr
    done = run("eval.py", *few, *folder[:2], "--compare", env=environment)
    assert done.returncode == 0, done.stderr


def test_errors_print_in_ascii():
    done = run("train.py", "--seed", "φ", env=os.environ | {"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 2 and "seed is 'phi'" in done.stderr


def test_a_printed_file_is_ascii_and_explains_every_setting():
    text = toml.text(run_config.Config("paper", 3, presets.PAPER))
    assert text.isascii()
    lines = text.splitlines()
    assert max(map(len, lines)) <= 100
    for i, written in enumerate(lines):
        if written.startswith(tuple(f"{field.name} = " for field in FIELDS)):
            assert lines[i - 1].startswith("# ") and not lines[i - 1].startswith("# ---")
    flat = text.replace("\n# ", " ")
    for field in FIELDS:
        assert streams.plain(help_text.meaning(field)) in flat
        assert fields.limits(field) in flat
    for title in fields.GROUPS.values():
        assert f"# --- {title} ---" in lines


@pytest.mark.parametrize("script", SCRIPTS)
def test_it_is_there_at_once(script):
    """0.07 s on the machine it was written on; what takes longer is an import that crept in."""
    heavy = ("jax", "numpy", "rich", "matplotlib", "flax", "orbax", "tensorboardX")
    code = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
import {script[:-3]} as script
try:
    script.main(["--help"])
except SystemExit:
    pass
print([name for name in {heavy} if name in sys.modules])
"""
    start = time.monotonic()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1] == "[]", done.stderr
    assert time.monotonic() - start < 5
