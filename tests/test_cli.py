"""train.py and eval.py as a user runs them."""

import csv
import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

from attjax import checkpoint, controllers, evaluation, learner

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))
import eval as eval_script  # noqa: E402
import train as train_script  # noqa: E402

TINY = [
    "--device=cpu", "--frameskips=5,20", "--num-envs=16", "--rollout-length=8",
    "--minibatch-size=32", "--hidden-sizes=16", "--updates-per-block=2",
]  # fmt: skip
STEPS_PER_UPDATE = 16 * 8


def run(script, *arguments, **options):
    command = [sys.executable, str(ROOT / script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


def metrics(folder):
    with (folder / "metrics.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A short run, and what train.py printed."""
    folder = tmp_path_factory.mktemp("runs") / "ckpt"
    result = run("train.py", *TINY, "--total-steps", 60 * STEPS_PER_UPDATE, "--checkpoint", folder)
    assert result.returncode == 0, result.stderr
    return folder, result.stdout


def test_training_reports_and_keeps_metrics(trained):
    folder, output = trained
    assert "7,680 agent steps (60 updates of 128)" in output
    assert "compiled in" in output and "M steps" in output and "ETA" in output
    assert output.strip().splitlines()[-1].endswith(f"python eval.py --checkpoint {folder}")
    rows = metrics(folder)
    assert [int(row["agent_steps"]) for row in rows] == list(range(256, 7681, 256))
    needed = {"agent_steps", "wall_s", "episode_return", "success_rate", "terminal_error_deg"}
    assert needed <= set(rows[0])
    walls = [float(row["wall_s"]) for row in rows]
    assert walls == sorted(walls)


def test_evaluation_prints_table_2_and_writes_json(trained, tmp_path):
    path = tmp_path / "result.json"
    result = run(
        "eval.py", "--checkpoint", trained[0], "--episodes", 20, "--frameskip", 20,
        "--duration", 4, "--seed", 3, "--json", path, "--device", "cpu",
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    for word in ("Mean", "Std. dev.", "Q2", "0.001954", "success", "overspeed"):
        assert word in result.stdout
    content = json.loads(path.read_text())
    assert list(content) == [
        "controller", "episodes", "frameskip", "control_hz", "duration_s", "seed",
        "success_rate", "overspeed_rate", "closest", "terminal", "terminal_success",
        "settling_time_s", "episode_return", "impulse_N_m_s",
    ]  # fmt: skip
    assert content["controller"] == "policy" and content["episodes"] == 20
    assert content["control_hz"] == pytest.approx(240 / 21)
    assert content["duration_s"] == pytest.approx(45 * 21 / 240)  # whole steps within 4 s
    assert content["seed"] == 3
    for state in ("closest", "terminal", "terminal_success"):
        assert set(content[state]) == {"error_deg", "rate_rad_s"}
        assert set(content[state]["error_deg"]) == set(evaluation.STATISTICS)
    assert set(content["settling_time_s"]) == {*evaluation.STATISTICS, "never"}


def test_classical_controllers_need_no_checkpoint(tmp_path):
    path = tmp_path / "result.json"
    result = run(
        "eval.py", "--controller", "phase-plane", "--episodes", 20, "--json", path,
        "--device", "cpu", cwd=tmp_path,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    content = json.loads(path.read_text())
    assert content["controller"] == "phase-plane" and content["success_rate"] == 1


def test_comparison_flies_the_same_slews(trained, tmp_path):
    path = tmp_path / "result.json"
    result = run(
        "eval.py", "--checkpoint", trained[0], "--compare", "--episodes", 10, "--duration", 5,
        "--json", path, "--device", "cpu",
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    header = next(line for line in result.stdout.splitlines() if "paper" in line)
    assert header.split() == ["policy", "phase-plane", "feedback", "paper"]
    results = json.loads(path.read_text())["controllers"]
    assert [r["controller"] for r in results] == ["policy", *eval_script.CLASSICAL]
    assert set(controllers.CONTROLLERS) == set(eval_script.CLASSICAL)
    assert len({(r["seed"], r["episodes"], r["duration_s"]) for r in results}) == 1


def test_a_stopped_run_goes_on_to_the_same_bits(trained, tmp_path):
    """SIGTERM after the third line, then --resume: as if it had never been stopped."""
    folder = tmp_path / "ckpt"
    arguments = [*TINY, "--total-steps", 60 * STEPS_PER_UPDATE, "--checkpoint", folder]
    command = [sys.executable, str(ROOT / "train.py"), *map(str, arguments)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if "ETA" in line:
                process.send_signal(signal.SIGTERM)
                break
        output = process.stdout.read()
    assert process.returncode in (143, 0)  # 0: it was faster than the signal
    if process.returncode == 143:
        assert "continue with --resume" in output
        assert 0 < checkpoint.latest(folder) < 60
    resumed = run("train.py", *arguments, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    whole, pieces = (
        [{k: v for k, v in row.items() if k != "wall_s"} for row in metrics(path)]
        for path in (trained[0], folder)
    )
    assert whole == pieces
    a, b = (checkpoint.restore_policy(path).args[0] for path in (trained[0], folder))
    jax.tree.map(np.testing.assert_array_equal, a, b)


def test_resume_starts_a_run_that_is_not_there(tmp_path):
    folder = tmp_path / "new"
    result = run("train.py", *TINY, "--total-steps", 1, "--checkpoint", folder, "--resume")
    assert result.returncode == 0, result.stderr
    assert checkpoint.latest(folder) == 1


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


def one_line_error(main, arguments, capsys):
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    output = capsys.readouterr()
    assert exit_.value.code == 2
    assert output.out == ""
    assert output.err.count("\n") == 1 and ": error: " in output.err
    return output.err


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
        (["--duration", "0.01", "--device", "cpu"], "at least one agent step of 0.025 s"),
        (["--checkpoint", "/nowhere", "--device", "cpu"], "no checkpoint folder /nowhere"),
        (["--checkpoint", str(ROOT / "tests"), "--device", "cpu"], "no attjax checkpoint"),
    ],
)
def test_bad_evaluation_arguments(arguments, named, capsys):
    assert named in one_line_error(eval_script.main, arguments, capsys)


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


def test_divergence_stops_with_status_3_and_keeps_the_last_good_checkpoint(
    trained, tmp_path, monkeypatch, capsys
):
    folder = tmp_path / "ckpt"
    shutil.copytree(trained[0], folder)
    before = checkpoint.latest(folder)
    restore = checkpoint.restore_learner

    def spoiled(*arguments) -> learner.Learner:
        state = restore(*arguments)
        broken = jax.tree.map(lambda x: x * np.nan, state.params)
        return state.replace(params=broken)

    monkeypatch.setattr(checkpoint, "restore_learner", spoiled)
    arguments = ["--resume", "--device", "cpu", "--checkpoint", str(folder)]
    status = train_script.main([*arguments, "--total-steps", str(70 * STEPS_PER_UPDATE)])
    error = capsys.readouterr().err
    assert status == 3
    assert "not finite at agent step 7,808 (update 60): losses, parameters;" in error
    assert checkpoint.latest(folder) == before
