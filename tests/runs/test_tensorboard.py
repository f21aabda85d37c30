"""The event files of --tensorboard tell what metrics.csv tells, whatever happened to the run."""

import csv
import os
import shutil
import subprocess
import sys
import time

import jax
import numpy as np
import pytest
from commands import ROOT, STEPS_PER_UPDATE, TINY, one_line_error, run, train_script
from setups import CONFIG

from attjax.runs import checkpoint, metrics, metrics_file
from attjax.runs import folder as run_folder

pytest.importorskip("tensorboardX")

from events import compared, points, records
from tensorboardX.proto.event_pb2 import SessionLog
from tensorboardX.proto.plugin_hparams_pb2 import HParamsPluginData

from attjax.runs import tensorboard


def expected(folder):
    """The same from metrics.csv."""
    with (folder / "metrics.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    curves, last_steps, last_seconds = {}, 0, 0.0
    for row in rows:
        steps, seconds = int(row["agent_steps"]), float(row["wall_s"])
        for metric in metrics.METRICS:
            if metric.tag and row[metric.name]:
                point = steps, float(np.float32(row[metric.name]))
                curves.setdefault(metric.tag, []).append(point)
        if seconds > last_seconds:
            rate = np.float32((steps - last_steps) / (seconds - last_seconds))
            curves.setdefault("time/steps_per_s", []).append((steps, float(rate)))
        last_steps, last_seconds = steps, seconds
    return curves


def row(steps, **values):
    cells = dict.fromkeys(metrics.columns())
    return cells | {"agent_steps": steps, "wall_s": steps / 100} | values


def test_every_column_is_a_curve():
    tags = {metric.name: metric.tag for metric in metrics.METRICS}
    assert tags.pop("agent_steps") is None  # which every curve is drawn against
    assert len({*tags.values(), tensorboard.RATE}) == len(tags) + 1
    assert all(tag.count("/") == 1 for tag in tags.values())


def test_points_are_those_of_the_rows(tmp_path):
    file = metrics_file.MetricsFile(tmp_path, 0)
    events = tensorboard.EventFile(tmp_path, CONFIG, file.kept)
    rows = [row(100, entropy=1 / 3), row(200, episode_return=1e-9, value_loss=float("inf"))]
    for each in [*rows, row(300, entropy=float("nan"))]:
        file.append(each)
        events.append(each)
    found = points(tmp_path)
    (step, entropy), (_, nan) = found.pop("policy/entropy")
    assert (step, entropy) == (100, np.float32("0.3333333")) and np.isnan(nan)
    assert found["time/steps_per_s"] == [(100, 100), (200, 100), (300, 100)]
    assert found["loss/value"] == [(200, np.inf)]
    assert found["episode/return"] == [(200, np.float32(1e-9))]
    assert "episode/success_rate" not in found  # no episode ended


def test_hyperparameters_are_all_of_the_run(tmp_path):
    tensorboard.EventFile(tmp_path, CONFIG, [])
    version, start, _, session = records(tmp_path)
    assert version.file_version == "brain.Event:2"
    assert (start.session_log.status, start.step) == (SessionLog.START, 0)
    (value,) = session.summary.value
    data = HParamsPluginData.FromString(value.metadata.plugin_data.content)
    shown = data.session_start_info.hparams
    assert set(shown) == {"preset", "seed", "spacecraft", *CONFIG.settings.flat}
    assert shown["spacecraft"].string_value == "LM50"
    assert shown["preset"].string_value == CONFIG.preset
    assert shown["clip"].number_value == CONFIG.settings.ppo.clip
    assert shown["frameskips"].string_value == ",".join(map(str, CONFIG.settings.task.frameskips))
    assert shown["stagger_episodes"].bool_value is CONFIG.settings.task.stagger_episodes
    assert compared(tmp_path) == [
        "episode/return", "episode/success_rate", "episode/overspeed_rate",
        "episode/terminal_error_deg",
    ]  # fmt: skip


def test_a_start_writes_the_kept_rows_anew(tmp_path):
    """Whatever stood there: rows after the checkpoint, half a record, half a file."""
    for steps_kept in (300, 200, 0):
        file = metrics_file.MetricsFile(tmp_path, steps_kept)
        events = tensorboard.EventFile(tmp_path, CONFIG, file.kept)
        assert points(tmp_path) == expected(tmp_path)
        done = int(file.kept[-1]["agent_steps"]) if file.kept else 0
        for steps in range(done + 100, 600, 100):
            for log in (file, events):
                log.append(row(steps, entropy=steps / 7))
        assert points(tmp_path) == expected(tmp_path)
        (path,) = (tmp_path / "tensorboard").iterdir()
        path.write_bytes(path.read_bytes()[:-5])
        path.with_name(path.name + ".tmp").write_bytes(b"half")


def test_the_clock_leaves_the_pauses_out(tmp_path):
    file = metrics_file.MetricsFile(tmp_path, 0)
    for steps in (100, 200):
        file.append(row(steps, entropy=1.0))
    kept = metrics_file.MetricsFile(tmp_path, 200).kept
    tensorboard.EventFile(tmp_path, CONFIG, kept).append(row(300, entropy=1.0))
    times = [e.wall_time for e in records(tmp_path) if e.step]
    np.testing.assert_allclose(np.diff(times), 1.0, atol=1e-6)


def test_a_run_with_event_files_is_the_same_run(trained, tmp_path):
    """SIGKILL amid it and --resume; the same policy to the bit, and curves as in metrics.csv."""
    folder = tmp_path / "ckpt"
    total = 60 * STEPS_PER_UPDATE
    flags = [*TINY, "--total-steps", total, "--checkpoint", folder, "--tensorboard", "--save-every"]
    command = [sys.executable, str(ROOT / "train.py"), *map(str, flags), "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        while process.poll() is None and (checkpoint.latest(folder) or 0) < 10:
            time.sleep(0.02)
        process.kill()
    assert 10 <= checkpoint.latest(folder) < 60
    resumed = run("train.py", *flags, 0, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert points(folder) == expected(folder)
    assert [step for step, _ in points(folder)["policy/entropy"]] == [*range(256, total + 1, 256)]
    a, b = (checkpoint.restore_policy(path).args[0] for path in (trained[0], folder))
    jax.tree.map(np.testing.assert_array_equal, a, b)


def test_a_run_that_has_ended_gets_its_event_file(trained, tmp_path, capsys):
    folder = tmp_path / "ckpt"
    shutil.copytree(trained[0], folder)
    arguments = ["--resume", "--device", "cpu", "--checkpoint", str(folder), "--tensorboard"]
    assert train_script.main(arguments) == 0
    assert points(folder) == expected(folder) and "policy/entropy" in points(folder)


@pytest.mark.parametrize("kept", [False, True])
def test_overwriting_removes_the_event_files_and_no_others(tmp_path, kept):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    tensorboard.EventFile(tmp_path, CONFIG, [])
    if kept:
        (tmp_path / "tensorboard" / "events.out.tfevents.1.another").touch()
    run_folder.create(tmp_path, CONFIG, overwrite=True)
    found = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*"))
    others = ["tensorboard", "tensorboard/events.out.tfevents.1.another"] if kept else []
    assert found == ["config.json", *others]


@pytest.mark.parametrize("name", ["metrics.csv", "tensorboard/events.out.tfevents.1.attjax"])
def test_what_a_run_without_configuration_left_is_refused_and_kept(tmp_path, name):
    (tmp_path / "tensorboard").mkdir()
    (tmp_path / name).touch()
    with pytest.raises(run_folder.FolderError, match="not empty"):
        run_folder.create(tmp_path, CONFIG, overwrite=False)
    assert (tmp_path / name).exists()


def test_a_linked_folder_of_several_runs_loses_no_event_files(tmp_path):
    (tmp_path / "events").mkdir()
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        run_folder.create(tmp_path / name, CONFIG, overwrite=False)
        (tmp_path / name / "tensorboard").symlink_to(tmp_path / "events")
        tensorboard.EventFile(tmp_path / name, CONFIG, [])
    assert len(list((tmp_path / "events").iterdir())) == 2
    tensorboard.EventFile(tmp_path / "one", CONFIG, [])
    assert len(list((tmp_path / "events").iterdir())) == 2


def test_without_tensorboardx_nothing_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "tensorboardX", None)
    folder = tmp_path / "ckpt"
    arguments = [*TINY, "--tensorboard", "--checkpoint", str(folder)]
    error = one_line_error(train_script.main, arguments, capsys)
    assert error.endswith("needs tensorboardX: pip install 'attjax[tensorboard]'\n")
    assert not folder.exists()


def test_a_full_disk_is_one_line(tmp_path, monkeypatch):
    events = tensorboard.EventFile(tmp_path, CONFIG, [])
    (path,) = (tmp_path / "tensorboard").iterdir()
    path.unlink()
    path.symlink_to("/dev/full")
    with pytest.raises(run_folder.FolderError, match="cannot be written: No space left"):
        events.append(row(100, entropy=1.0))


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_one_line(trained, tmp_path, capsys):
    folder = tmp_path / "ckpt"
    shutil.copytree(trained[0], folder)
    (folder / "tensorboard").mkdir(mode=0o500)
    arguments = ["--resume", "--device", "cpu", "--checkpoint", str(folder), "--tensorboard"]
    assert "cannot be written" in one_line_error(train_script.main, arguments, capsys)


def test_a_file_in_the_place_of_the_folder_is_one_line(trained, tmp_path, capsys):
    folder = tmp_path / "ckpt"
    shutil.copytree(trained[0], folder)
    (folder / "tensorboard").write_text("precious")
    arguments = ["--resume", "--device", "cpu", "--checkpoint", str(folder), "--tensorboard"]
    assert "cannot be written" in one_line_error(train_script.main, arguments, capsys)
    assert (folder / "tensorboard").read_text() == "precious"
