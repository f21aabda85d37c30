"""train.py where something ends it: memory, a disk, another run, a signal."""

import shutil
import signal
import subprocess
import sys

import pytest
from commands import ROOT, TINY, one_line_error, run, train_script

from attjax.ppo import train_state
from attjax.runs import checkpoint
from attjax.runs import folder as run_folder


def test_too_little_memory_is_one_line(tmp_path, monkeypatch, capsys):
    def too_much(*_):
        raise RuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 1099511627776 bytes.")

    monkeypatch.setattr(train_state, "init", too_much)
    arguments = [*TINY, "--checkpoint", str(tmp_path / "run")]
    assert "fewer --num-envs" in one_line_error(train_script.main, arguments, capsys)


def test_a_full_disk_ends_in_one_line_with_the_older_checkpoint_intact(trained, tmp_path):
    """No file may grow beyond what is too little for a checkpoint, as on a disk that is full."""
    folder = tmp_path / "ckpt"
    shutil.copytree(trained[0], folder)
    before = {p: p.read_bytes() for p in (folder / "60").rglob("*") if p.is_file()}
    code = f"""
import resource, sys
sys.path.insert(0, {str(ROOT)!r})
import train
resource.setrlimit(resource.RLIMIT_FSIZE, (8000, 8000))
sys.exit(train.main(sys.argv[1:]))
"""
    flags = ["--resume", "--device=cpu", "--checkpoint", str(folder), "--total-steps=16000"]
    command = [sys.executable, "-W", "ignore", "-c", code, *flags]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1 and "cannot be written: " in done.stderr, done.stderr
    assert before == {p: p.read_bytes() for p in (folder / "60").rglob("*") if p.is_file()}
    assert checkpoint.latest(folder) == 60
    assert run("train.py", *flags).returncode == 0


def test_a_disk_that_is_full_is_not_taken_for_too_little_memory(tmp_path, monkeypatch, capsys):
    def full(*_, **__):
        raise ValueError("RESOURCE_EXHAUSTED: Failed to write: No space left on device")

    monkeypatch.setattr(checkpoint.ocp.Checkpointer, "save", full)
    arguments = [*TINY, "--total-steps", "1", "--checkpoint", str(tmp_path / "run")]
    with pytest.raises(SystemExit) as exit_:
        train_script.main(arguments)
    error = capsys.readouterr().err
    assert exit_.value.code == 2 and error.count("\n") == 1
    assert "1 cannot be written" in error and "No space left" in error and "memory" not in error


def test_a_second_run_in_a_folder_in_use_is_refused(trained, tmp_path, capsys):
    folder = tmp_path / "ckpt"
    shutil.copytree(trained[0], folder)
    with run_folder.opened(folder):
        for flag in ("--resume", "--overwrite"):
            arguments = [flag, "--device", "cpu", "--checkpoint", str(folder)]
            assert "in use by another" in one_line_error(train_script.main, arguments, capsys)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_the_first_block_saves_the_start(tmp_path, number):
    """It comes as soon as the signal is listened to, long before JAX is ready."""
    code = f"""
import os, sys
sys.path.insert(0, {str(ROOT)!r})
from attjax import devices
import train
select = devices.select_device
def select_device(name):
    os.kill(os.getpid(), {int(number)})
    return select(name)
devices.select_device = select_device
sys.exit(train.main(sys.argv[1:]))
"""
    folder = tmp_path / "run"
    command = [sys.executable, "-c", code, *TINY, "--checkpoint", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 128 + number, done.stderr
    assert done.stdout.endswith("stopped and saved at 0 agent steps; continue with --resume\n")
    assert done.stderr == "" and checkpoint.latest(folder) == 0


def test_a_second_signal_ends_the_process_at_once(tmp_path):
    code = """
import os, signal
from attjax.runs import signals
with signals.StopSignals() as stop:
    os.kill(os.getpid(), signal.SIGTERM)
    assert stop.received == signal.SIGTERM
    os.kill(os.getpid(), signal.SIGINT)
    print("alive")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == -signal.SIGINT
    assert done.stdout == done.stderr == ""
