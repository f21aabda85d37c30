"""Bad input to the command line: one line that names what is allowed, and exit status 2."""

import shutil

import jax
import pytest
from commands import ROOT, eval_script, one_line_error, train_script


def test_resume_refuses_settings_that_would_change_the_run(trained, capsys):
    folder = str(trained[0])
    for flags, named in (
        (["--clip", "0.1"], "clip (0.2)"),
        (["--seed", "5"], "seed (0)"),
        (["--preset", "paper"], "preset (precise)"),
        (["--total-steps", "5"], "--total-steps is 5"),
    ):
        arguments = ["--resume", "--device", "cpu", "--checkpoint", folder, *flags]
        assert named in one_line_error(train_script.main, arguments, capsys)


@pytest.mark.parametrize(
    "arguments, named",
    [
        (["--preset", "fast"], "paper-fast"),
        (["--num-envs", "0"], "num_envs is 0; it must be an integer at least 1"),
        (["--num-envs", "-3"], "num_envs is -3"),
        (["--num-envs", "2.5"], "num_envs is '2.5'"),
        (["--num-envs", "many"], "num_envs is 'many'"),
        (["--total-steps", "0"], "total_steps"),
        (["--total-steps", "1e6"], "total_steps"),
        (["--frameskips", "5,-1"], "frameskips"),
        (["--frameskips", "5,,7"], "frameskips"),
        (["--hidden-sizes", "64,x"], "hidden_sizes"),
        (["--learning-rate", "nan"], "learning_rate"),
        (["--seed", "-1"], "seed is -1"),
        (["--seed", "4294967296"], "seed"),
        (["--num-envs", "4"], "num_envs is 4; it must be at least 5"),
        (["--num-envs", "4194304"], "it must be at most 134217728"),
        (["--total-steps", "9999999999999"], "fewer than 2^31"),
        (["--hidden-sizes", "8,8,8,8,8,8,8,8,8"], "8 of them at most"),
        (["--save-every", "-1"], "save-every is -1"),
        (["--device", "tpu"], "cpu"),
        (["--resume", "--overwrite"], "not allowed with"),
        (["--unknown"], "--unknown"),
    ],
)
def test_bad_training_arguments(arguments, named, capsys):
    assert named in one_line_error(train_script.main, arguments, capsys)


@pytest.mark.parametrize(
    "arguments, named",
    [
        (["--episodes", "0"], "episodes is 0; it must be an integer at least 1"),
        (["--frameskip", "-1"], "frameskip is -1"),
        (["--frameskip", "1.5"], "frameskip is '1.5'"),
        (["--duration", "0"], "duration is 0.0"),
        (["--duration", "inf"], "duration is inf"),
        (
            ["--duration", "0.01", "--frameskip", "5", "--device", "cpu"],
            "at least one agent step of 0.025 s",
        ),
        (["--checkpoint", "/nowhere", "--device", "cpu"], "no checkpoint folder /nowhere"),
        (["--checkpoint", str(ROOT / "tests"), "--device", "cpu"], "no attjax checkpoint"),
    ],
)
def test_bad_evaluation_arguments(arguments, named, capsys):
    assert named in one_line_error(eval_script.main, arguments, capsys)


def test_a_metrics_file_that_cannot_be_drawn_is_refused_before_the_work(trained, tmp_path, capsys):
    folder = tmp_path / "run"
    shutil.copytree(trained[0], folder)
    (folder / "metrics.csv").write_text("agent_steps\nmany\n")
    flags = ["--device", "cpu", "--checkpoint", str(folder), "--plot", str(tmp_path / "figures")]
    assert "metrics.csv cannot be read" in one_line_error(eval_script.main, flags, capsys)


def test_runs_and_folders_that_cannot_be_used(trained, tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("text")
    for folder, named in (
        (trained[0], "--overwrite"),
        (file, "cannot be written"),
        (file / "below", "cannot be written"),
        ("/proc/nowhere", "cannot be written"),
        (ROOT / "tests", "not empty"),
    ):
        arguments = ["--device", "cpu", "--checkpoint", str(folder)]
        assert named in one_line_error(train_script.main, arguments, capsys)
    assert file.read_text() == "text"


def test_json_that_cannot_be_written_is_refused_before_the_work(trained, tmp_path, capsys):
    arguments = ["--device", "cpu", "--checkpoint", str(trained[0]), "--json"]
    error = one_line_error(eval_script.main, [*arguments, str(tmp_path / "no" / "x")], capsys)
    assert "cannot be written" in error


def test_a_missing_device_is_named(tmp_path, capsys, monkeypatch):
    def only_cpu(name=None):
        if name == "gpu":
            raise RuntimeError("Unknown backend")
        return jax.local_devices(backend="cpu")

    monkeypatch.setattr(jax, "devices", only_cpu)
    arguments = ["--device", "gpu", "--checkpoint", str(tmp_path / "x")]
    assert "--device is gpu" in one_line_error(train_script.main, arguments, capsys)
    assert not (tmp_path / "x").exists()
