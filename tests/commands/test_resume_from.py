"""``train.py --resume-from``: what it refuses, in one line, and the file that describes it."""

import json
import os
import shutil

import pytest
from commands import ROOT, one_line_error, run, train_script

from attjax.config import toml
from attjax.runs import folder as run_folder
from attjax.runs import origin

PRECISE, PAPER = (ROOT / "pretrained" / name for name in ("precise", "paper"))
THREE_AXES = "inertia = [1, 1, 1]\ntorque_levels = [0.5, 0.05]\n"


def train(*flags):
    return [str(x) for x in ("--device=cpu", "--resume-from", PRECISE, *flags)]


@pytest.mark.parametrize(
    "flags, named",
    [
        (["--hidden-sizes", "64,32"], "hidden_sizes is (64, 32), not (64, 64)"),
        (["--features", "state"], "features is state, not multiscale"),
        (["--actions", "continuous"], "actions is continuous, not discrete"),
        (["--initial-weights", "uniform"], "initial_weights is uniform, not orthogonal"),
        (["--no-observes-quaternion-rate"], "observes_quaternion_rate is False, not True"),
        (["--preset", "paper"], "features is state, not multiscale; hidden_sizes is (400, 300)"),
        (["--resume-from", "nowhere"], "there is no checkpoint folder"),
        (["--resume-from", ROOT], "is no attjax checkpoint"),
        (["--resume-from", ""], "the path is ''"),
        (["--resume-from", PRECISE, "--resume", "--overwrite"], "not allowed with"),
    ],
)
def test_what_is_refused(flags, named, tmp_path, capsys, no_work):
    flags = train(*flags, "--checkpoint", tmp_path / "new")
    assert named in one_line_error(train_script.main, flags, capsys)
    assert not list(tmp_path.rglob("config.json"))


def test_a_spacecraft_with_another_number_of_actions_is_refused(tmp_path, capsys, no_work):
    (tmp_path / "two.toml").write_text(THREE_AXES)
    flags = train("--spacecraft", tmp_path / "two.toml", "--checkpoint", tmp_path / "new")
    error = one_line_error(train_script.main, flags, capsys)
    assert "keeps the networks of" in error and "two has 13 actions, not 19" in error


def test_an_episode_that_is_too_short_is_one_line(tmp_path, capsys, no_work):
    short = "inertia = [1, 1, 1]\ntorque_levels = [0.5, 0.05, 0.005]\nduration = 0.05\n"
    (tmp_path / "short.toml").write_text(short)
    flags = train("--spacecraft", tmp_path / "short.toml", "--checkpoint", tmp_path / "new")
    for more in ([], ["--resume"]):
        error = one_line_error(train_script.main, [*flags, *more], capsys)
        assert "frameskips holds 20; in 0.05 s" in error


def test_universal_inputs_fit_any_number_of_actions(tmp_path):
    """Its networks choose from a list of their own."""
    (tmp_path / "two.toml").write_text(THREE_AXES)
    given = {"resume_from": ROOT / "pretrained" / "universal", "any_spacecraft": False}
    craft = toml.read_spacecraft(tmp_path / "two.toml")
    assert origin.new({**given, "spacecraft": craft}).spacecraft.num_actions == 13


@pytest.mark.parametrize("flags", [[], ["--overwrite"], ["--resume"]])
def test_its_own_folder_is_refused(tmp_path, capsys, flags, no_work):
    folder = shutil.copytree(PRECISE, tmp_path / "old")
    before = sorted(path.name for path in folder.iterdir())
    os.symlink(folder, tmp_path / "link")
    flags = ["--resume-from", folder, "--checkpoint", tmp_path / "link", *flags]
    error = one_line_error(train_script.main, train(*flags), capsys)
    if "--resume" in flags:
        assert "leave out resume_from (None)" in error
    else:
        assert "--resume goes on with its run" in error
    assert sorted(path.name for path in folder.iterdir()) == before


def test_a_run_without_checkpoint_is_refused(tmp_path, capsys, no_work):
    shutil.copy(PRECISE / "config.json", tmp_path)
    flags = train("--resume-from", tmp_path, "--checkpoint", tmp_path / "new")
    assert "holds no checkpoint yet" in one_line_error(train_script.main, flags, capsys)


def test_a_run_of_another_learner_is_refused(tmp_path, capsys, no_work):
    folder = shutil.copytree(PRECISE, tmp_path / "td3")
    content = json.loads((folder / "config.json").read_text())
    (folder / "config.json").write_text(json.dumps(content | {"preset": "td3"}))
    flags = train("--resume-from", folder, "--checkpoint", tmp_path / "new")
    error = one_line_error(train_script.main, flags, capsys)
    assert "--resume-from takes runs of PPO" in error and "is one of TD3" in error


def test_the_file_that_is_printed_describes_the_same_run(tmp_path, capsys, no_work):
    flags = ["--spacecraft", str(ROOT / "docs/examples/lm50-doubled.toml"), "--seed", "3"]
    assert train_script.main([*train(), *flags, "--print-config"]) == 0
    text = capsys.readouterr().out
    assert f'resume_from = "{PRECISE}"' in text
    (tmp_path / "run.toml").write_text(text)
    again = origin.new(toml.read(tmp_path / "run.toml"))
    assert again.resumed_from == run_folder_origin(PRECISE)
    assert (again.spacecraft.name, again.seed) == ("LM50, doubled", 3)
    assert toml.text(again) == text
    flags = ["--config", str(tmp_path / "run.toml"), "--print-config", "--clip", "0.1"]
    assert train_script.main([*flags, "--resume-from", str(PRECISE)]) == 0
    assert "clip = 0.1" in capsys.readouterr().out


def run_folder_origin(folder):
    """What is known of a folder of the repository's."""
    newest = max(int(path.name) for path in folder.iterdir() if path.is_dir())
    return run_folder.Origin(str(folder), None, newest, False)


@pytest.mark.parametrize("path", ["", "\\u0000", "~nobody-of-that-name/x", "nowhere"])
def test_folders_in_a_file_that_are_none(tmp_path, capsys, path, no_work):
    (tmp_path / "run.toml").write_text(f'resume_from = "{path}"\n')
    flags = ["--device=cpu", "--config", str(tmp_path / "run.toml")]
    flags += ["--checkpoint", str(tmp_path / "new")]
    one_line_error(train_script.main, flags, capsys)


def test_it_says_what_it_begins_with(tmp_path):
    small = ["--num-envs=16", "--rollout-length=8", "--minibatch-size=32", "--total-steps=1"]
    result = run("train.py", *train(*small, "--checkpoint", tmp_path))
    assert result.returncode == 0, result.stderr
    assert (
        f"begins with the networks of update 306 of {PRECISE}, which holds no value network: "
        "that begins anew"
    ) in result.stdout.splitlines()
    again = run("train.py", *train(*small, "--checkpoint", tmp_path, "--resume"))
    assert again.returncode == 0, again.stderr
    assert "begins with" not in again.stdout and "resumed at 128" in again.stdout
