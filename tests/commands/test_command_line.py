"""train.py and eval.py as a user runs them."""

import csv
import json
import re
import shutil
import signal
import subprocess
import sys

import jax
import numpy as np
import pytest
from commands import ROOT, STEPS_PER_UPDATE, TINY, eval_script, run, train_script

from attjax import evaluation
from attjax.control import classical
from attjax.ppo import train_state
from attjax.runs import checkpoint
from attjax.runs import folder as run_folder


def metrics(folder):
    with (folder / "metrics.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_training_reports_and_keeps_metrics(trained):
    folder, output = trained
    assert "7,680 agent steps (60 updates of 128)" in output
    assert "compiled in" in output and "/7.68k steps" in output and "ETA" in output
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
    assert set(classical.CONTROLLERS) == set(eval_script.CLASSICAL)
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


def test_divergence_stops_with_status_3_and_keeps_the_last_good_checkpoint(
    trained, tmp_path, monkeypatch, capsys
):
    folder = tmp_path / "ckpt"
    shutil.copytree(trained[0], folder)
    before = checkpoint.latest(folder)
    restore = checkpoint.restore_learner

    def spoiled(*arguments) -> train_state.Learner:
        state = restore(*arguments)
        broken = jax.tree.map(lambda x: x * np.nan, state.params)
        return state.replace(params=broken)

    monkeypatch.setattr(checkpoint, "restore_learner", spoiled)
    arguments = ["--resume", "--device", "cpu", "--checkpoint", str(folder)]
    status = train_script.main([*arguments, "--total-steps", str(70 * STEPS_PER_UPDATE)])
    error = capsys.readouterr().err
    assert status == 3
    assert "not finite at agent step 7,808 (update 60): losses, parameters;" in error
    assert error.count("\n") == 1 and f"has the good one of update {before}" in error
    assert checkpoint.latest(folder) == before


def test_debugging_names_the_operation_that_made_a_nan(tmp_path, capsys):
    arguments = [*TINY, "--checkpoint", str(tmp_path / "run"), "--learning-rate", "1e18"]
    assert train_script.main([*arguments, "--debug-nans"]) == 3
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "(updates 0 to 1): nan generated by primitive: " in error
    assert re.search(r", in \w+\.py, line \d+, \w+", error) and "no checkpoint yet" in error
    total = ["--total-steps", str(2 * STEPS_PER_UPDATE)]
    healthy = [*TINY, *total, "--checkpoint", str(tmp_path / "healthy")]
    assert train_script.main([*healthy, "--debug-nans"]) == 0


def test_a_larger_total_anneals_on_and_says_so(trained, tmp_path, capsys):
    folder = tmp_path / "ckpt"
    shutil.copytree(trained[0], folder)
    arguments = ["--resume", "--device", "cpu", "--checkpoint", str(folder)]
    assert train_script.main([*arguments, "--total-steps", str(120 * STEPS_PER_UPDATE)]) == 0
    output = capsys.readouterr().out
    assert "total steps raised from 7,680 to 15,360" in output
    assert "at 7,680 the learning rate goes from 1e-06 to 0.001, and" in output
    assert run_folder.read_config(folder).settings.ppo.total_steps == 15_360
    assert checkpoint.latest(folder) == 120
