"""Paths and files that users name: read or written, or refused in a line, whatever they are."""

import codecs
import json
import os
from pathlib import Path

import pytest
from commands import eval_script, export_script, one_line_error, python, train_script

from attjax.config import command_line, presets, toml
from attjax.config import run as run_config
from attjax.runs import folder as run_folder

SCRIPTS = {"train.py": train_script, "eval.py": eval_script, "export.py": export_script}


@pytest.mark.parametrize(
    "script, flag",
    [
        ("train.py", "--checkpoint"), ("train.py", "--config"), ("train.py", "--spacecraft"),
        ("eval.py", "--checkpoint"), ("eval.py", "--spacecraft"), ("eval.py", "--json"),
        ("eval.py", "--plot"), ("eval.py", "--playback"),
        ("export.py", "--checkpoint"), ("export.py", "--out"),
    ],
)  # fmt: skip
def test_paths_that_no_file_can_have_are_one_line(trained, tmp_path, capsys, script, flag):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "file").write_text("no TOML")
    needed = {} if script == "train.py" else {"--checkpoint": str(trained[0])}
    if script == "export.py":
        needed |= {"--format": "c", "--out": str(tmp_path / "flight")}
    for path, named in (
        ("", "the path is ''"),
        ("a\0b", "no NUL"),
        ("~nobody-of-this-name/x", "there is no home for '~nobody-of-this-name/x'"),
        (tmp_path / ("x" * 5000), ""),
        (tmp_path / "loop" / "x", str(tmp_path)),
        (tmp_path / "file" / "x", str(tmp_path)),
    ):
        words = [word for pair in (needed | {flag: str(path)}).items() for word in pair]
        error = one_line_error(SCRIPTS[script].main, ["--device", "cpu", *words], capsys)
        assert named in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "loop"]


LOOKING = [
    *((script, what) for script in SCRIPTS for what in ("is_dir", "is_file", "listdir", "mkdir"))
]
LOOKING.remove(("eval.py", "mkdir"))  # it makes no folder there


@pytest.mark.parametrize("script, what", LOOKING)
def test_folders_that_may_not_be_entered_are_one_line(trained, capsys, monkeypatch, script, what):
    """As for anybody but root, for whom there are none: each way to look into one fails."""
    owner = os if what == "listdir" else Path
    call = getattr(owner, what)

    def locked(path, *arguments, **options):
        if Path(path).is_relative_to(trained[0]):
            raise PermissionError(13, "Permission denied", str(path))
        return call(path, *arguments, **options)

    monkeypatch.setattr(owner, what, locked)
    more = {"train.py": ["--resume"], "eval.py": ["--episodes", "1", "--duration", "0.1"]}
    more["export.py"] = ["--format", "c", "--out", str(trained[0] / "flight")]
    flags = ["--device", "cpu", "--checkpoint", str(trained[0]), *more[script]]
    assert str(trained[0]) in one_line_error(SCRIPTS[script].main, flags, capsys)


def test_a_new_folder_may_hold_hidden_files_and_the_log_of_its_own_run(tmp_path):
    for name in (".gitkeep", ".DS_Store"):
        (tmp_path / name).touch()
    (tmp_path / "lost+found").mkdir()
    code = f"""
from pathlib import Path
from attjax.runs import folder as run_folder
from attjax.config import run as run_config
from attjax.config import presets
config = run_config.Config("paper", 0, presets.PAPER)
run_folder.create(Path({str(tmp_path)!r}), config, overwrite=False)
"""
    with (tmp_path / "log").open("w") as log:
        assert python(code, capture_output=False, stdout=log, stderr=log).returncode == 0
    (tmp_path / run_folder.CONFIG).unlink()
    config = run_config.Config("paper", 0, presets.PAPER)
    with pytest.raises(run_folder.FolderError, match="holds no attjax run, but log; choose"):
        run_folder.create(tmp_path, config, overwrite=False)
    (tmp_path / "log").unlink()
    (tmp_path / ".git").mkdir()
    with pytest.raises(run_folder.FolderError, match=r"but \.git; choose"):
        run_folder.create(tmp_path, config, overwrite=False)


@pytest.mark.parametrize(
    "mark, encoding",
    [
        (codecs.BOM_UTF8, "utf-8"),
        (codecs.BOM_UTF16_LE, "utf-16-le"),
        (codecs.BOM_UTF16_BE, "utf-16-be"),
    ],
)
def test_toml_with_a_byte_order_mark_is_read(tmp_path, mark, encoding):
    path = tmp_path / "run.toml"
    path.write_bytes(mark + 'preset = "paper"\r\nseed = 5 # Größe\r\n'.encode(encoding))
    assert toml.read(path) == {"preset": "paper", "seed": 5}
    craft = 'name = "Größe"\ninertia = [1, 1, 1]\ntorque_levels = [0.1]\n'
    path.write_bytes(mark + craft.encode(encoding))
    assert toml.read_spacecraft(path).name == "Größe"


def test_toml_of_endless_depth_is_one_line(tmp_path, capsys):
    path = tmp_path / "run.toml"
    path.write_text("seed = " + "[" * 100_000)
    for flag in ("--config", "--spacecraft"):
        assert "is no TOML" in one_line_error(train_script.main, [flag, str(path)], capsys)


def test_a_tilde_is_the_home_where_the_shell_leaves_it(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert command_line.path("~/runs/a") == tmp_path / "runs" / "a"
    arguments = train_script.parse_arguments(["--checkpoint=~/a", "--config=~/b", "--spacecraft=~"])
    assert arguments.checkpoint == tmp_path / "a" and arguments.config == tmp_path / "b"
    assert arguments.spacecraft == tmp_path


def test_json_to_stdout_leaves_the_report_to_stderr(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    flags = ["--controller=feedback", "--episodes=5", "--duration=1", "--device=cpu"]
    assert eval_script.main([*flags, "--json", "-"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["episodes"] == 5
    assert "feedback: 5 slews" in printed.err and not list(tmp_path.iterdir())
