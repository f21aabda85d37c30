"""What asks a run to stop: signals of people, terminals and batch systems."""

import signal
import subprocess
import sys
import threading

import pytest
from commands import ROOT, TINY, train_script

from attjax.runs import checkpoint

HEARD = ["SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1", "SIGUSR2", "SIGXCPU"]
STOP = """
import os, signal, sys
from attjax.runs import signals
with signals.StopSignals() as stop:
    for name in sys.argv[1:]:
        os.kill(os.getpid(), getattr(signal, name))
    print(stop.received)
"""


def stopped(*names, before=()):
    """What a process that gets these signals in turn says that it received."""
    command = [*before, sys.executable, "-c", STOP, *names]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT)


@pytest.mark.parametrize("name", HEARD)
def test_it_is_heard(name):
    done = stopped(name)
    assert (done.returncode, done.stdout) == (0, f"{int(getattr(signal, name))}\n"), done.stderr


@pytest.mark.parametrize("names", [("SIGHUP", "SIGHUP"), ("SIGTERM", "SIGHUP"), ("SIGUSR1",) * 3])
def test_what_comes_twice_by_itself_ends_nothing(names):
    """As a shell and the system both send SIGHUP, or systemd SIGTERM and SIGHUP."""
    done = stopped(*names)
    assert (done.returncode, done.stdout) == (0, f"{int(getattr(signal, names[0]))}\n"), done.stderr


@pytest.mark.parametrize("second", ["SIGINT", "SIGTERM"])
def test_a_second_wish_of_the_users_ends_it_at_once(second):
    assert stopped("SIGHUP", second).returncode == -getattr(signal, second)


@pytest.mark.parametrize("name", HEARD[2:])
def test_what_was_ignored_at_the_start_stays_ignored(name):
    """As SIGHUP is after nohup."""
    done = stopped(name, before=["bash", "-c", f"trap '' {name}; exec \"$@\"", "bash"])
    assert (done.returncode, done.stdout) == (0, "None\n"), done.stderr


@pytest.mark.parametrize("name", ["SIGHUP", "SIGUSR1"])
def test_a_run_is_saved_and_its_status_names_the_signal(tmp_path, name):
    command = [sys.executable, str(ROOT / "train.py"), *TINY, "--checkpoint", str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if "ETA" in line:
                process.send_signal(getattr(signal, name))
                break
        output = process.stdout.read()
    assert process.returncode == 128 + getattr(signal, name)
    assert "stopped and saved at" in output and checkpoint.latest(tmp_path) > 0


def test_a_run_in_a_thread_hears_none_and_goes_on(tmp_path, capsys):
    status = []
    arguments = [*TINY, "--total-steps", "1", "--checkpoint", str(tmp_path)]
    thread = threading.Thread(target=lambda: status.append(train_script.main(arguments)))
    thread.start()
    thread.join()
    assert status == [0] and checkpoint.latest(tmp_path) == 1
