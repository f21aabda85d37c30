"""TOML files that describe a run."""

import tomllib

import pytest
from commands import ROOT, one_line_error, run, train_script

from attjax.config import presets, toml
from attjax.config import run as run_config
from attjax.errors import UserError
from attjax.runs import folder as run_folder
from attjax.spacecraft import LM50


@pytest.mark.parametrize("preset", presets.PRESETS)
def test_a_printed_file_reads_as_what_it_was_printed_from(tmp_path, preset):
    path = tmp_path / "run.toml"
    path.write_text(toml.text(run_config.Config(preset, 7, presets.PRESETS[preset])))
    expected = {"preset": preset, "seed": 7, "spacecraft": LM50} | presets.PRESETS[preset].flat
    assert toml.read(path) == expected


def test_flags_override_the_file_and_the_file_the_preset(tmp_path, capsys):
    path = tmp_path / "run.toml"
    path.write_text('preset = "paper"\nseed = 5\n[settings]\nclip = 0.3\nnum_envs = 64\n')
    assert train_script.main(["--config", str(path), "--num-envs", "32", "--print-config"]) == 0
    printed = tomllib.loads(capsys.readouterr().out)
    assert (printed["preset"], printed["seed"]) == ("paper", 5)
    assert (printed["settings"]["clip"], printed["settings"]["num_envs"]) == (0.3, 32)
    assert printed["settings"]["passes"] == presets.PAPER.ppo.passes


def test_a_printed_file_reproduces_the_run_and_agrees_with_resuming_it(trained, tmp_path, capsys):
    config = run_folder.read_config(trained[0])
    path = tmp_path / "run.toml"
    path.write_text(toml.text(config))
    folder = tmp_path / "again"
    flags = ["--config", path, "--device", "cpu", "--checkpoint"]
    for _ in range(2):
        done = run("train.py", *flags, folder, "--resume")
        assert done.returncode == 0, done.stderr
    assert run_folder.read_config(folder) == config
    path.write_text(path.read_text().replace("clip = 0.2", "clip = 0.1"))
    named = one_line_error(train_script.main, [*map(str, flags), str(folder), "--resume"], capsys)
    assert "clip (0.2)" in named


@pytest.mark.parametrize(
    "text, expected",
    [
        ("clip = 0.1", "unknown names: clip"),
        ("[settings]\nfoo = 1", "unknown names: foo"),
        ("[settings]\nclip = 2.0", "clip is 2.0; it must be a number above 0 and below 1"),
        ("[settings]\nframeskips = [5, true]", "frameskips is (5, True); it must be integers"),
        ("[settings]\nfeatures = 3", "one of state, multiscale"),
        ("seed = -1", "seed is -1; it must be an integer at least 0 and below 4294967296"),
        (
            'preset = "best"',
            "preset is 'best'; it must be one of precise, precise-gpu, universal",
        ),
        ("preset = [[1]]", "it must be one of precise"),
        ("settings = 3", "settings must be a table"),
        ("[settings", "is no TOML"),
        ("\x00", "is no TOML"),
    ],
)
def test_bad_files(tmp_path, capsys, text, expected):
    path = tmp_path / "run.toml"
    path.write_text(text)
    assert expected in one_line_error(train_script.main, ["--config", str(path)], capsys)
    path.write_bytes(b"\xff\xfe\xff")  # half a character of UTF-16
    assert "is no TOML" in one_line_error(train_script.main, ["--config", str(path)], capsys)


def test_files_that_cannot_be_read(tmp_path, capsys):
    for path in (tmp_path, tmp_path / "missing.toml"):
        error = one_line_error(train_script.main, ["--config", str(path)], capsys)
        assert f"--config {path} cannot be read" in error
    with pytest.raises(UserError):
        toml.read(ROOT / "nowhere")
