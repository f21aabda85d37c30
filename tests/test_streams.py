"""Where printing fails the work is done all the same, and the exit status tells."""

import json
import os
import signal
import subprocess
import sys

import pytest
from commands import ROOT, STEPS_PER_UPDATE, TINY

from attjax.runs import checkpoint

FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full")
UNBUFFERED = pytest.mark.parametrize("unbuffered", ["", "1"])


def shell(line, unbuffered=""):
    """Run a line of bash in which $TRAIN, $EVAL and $EXPORT are the programs."""
    programs = {name: f"{sys.executable} {ROOT}/{name.lower()}.py" for name in PROGRAMS}
    environment = os.environ | programs | {"PYTHONUNBUFFERED": unbuffered}
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {line}"],
        capture_output=True, text=True, env=environment, timeout=300,
    )  # fmt: skip


PROGRAMS = ("TRAIN", "EVAL", "EXPORT")
ONE_LINE = ".py: error: all is done, but stdout failed: No space left on device\n"


@FULL
@UNBUFFERED
@pytest.mark.parametrize("program", PROGRAMS)
def test_help_on_a_full_device_is_one_line(program, unbuffered):
    done = shell(f"${program} --help > /dev/full", unbuffered)
    assert done.returncode == 1
    assert done.stderr == program.lower() + ONE_LINE


@FULL
def test_a_described_run_on_a_full_device_is_one_line():
    done = shell("$TRAIN --print-config > /dev/full")
    assert (done.returncode, done.stderr) == (1, "train" + ONE_LINE)


@UNBUFFERED
@pytest.mark.parametrize("flag", ["--help", "--print-config"])
def test_a_reader_that_leaves_is_no_matter(flag, unbuffered):
    done = shell(f"$TRAIN {flag} | true", unbuffered)
    assert done.returncode in (0, 1) and done.stderr == ""  # 0: all was written before it left


@FULL
def test_errors_that_cannot_be_printed_have_their_status():
    assert shell("$TRAIN --seed x 2> /dev/full").returncode == 2
    done = shell("$TRAIN --seed x 2>&-")
    assert (done.returncode, done.stdout) == (2, "")


def test_a_closed_stream_is_not_taken_for_a_file():
    """What is opened first has the number of the closed one: it would be printed into."""
    code = "from attjax import streams\nwith streams.guarded(): print(open('README.md').fileno())"
    done = shell(f'cd {ROOT}; {sys.executable} -c "{code}" 2>&- <&-')
    assert done.returncode == 0 and int(done.stdout) > 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a run whose reader left after its first line, as with | head -1."""
    folder = tmp_path_factory.mktemp("run") / "ckpt"
    flags = [*TINY, f"--total-steps={4 * STEPS_PER_UPDATE}", "--checkpoint", folder]
    done = shell(f"$TRAIN {' '.join(map(str, flags))} | head -1")
    assert (done.returncode, done.stderr) == (1, "") and done.stdout.count("\n") == 1
    return folder


def test_a_run_whose_reader_leaves_is_trained_and_saved(folder):
    assert checkpoint.latest(folder) == 4


def test_an_interrupted_run_whose_reader_is_gone_is_saved(tmp_path):
    """Ctrl-C in ``train.py | tee log`` reaches tee, too."""
    command = [sys.executable, str(ROOT / "train.py"), *TINY, "--checkpoint", str(tmp_path)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **pipes) as process:
        for line in process.stdout:
            if "ETA" in line:
                break
        process.stdout.close()
        process.send_signal(signal.SIGINT)
        error = process.stderr.read()
    assert (process.returncode, error) == (130, "")
    assert checkpoint.latest(tmp_path) > 0


@FULL
def test_evaluation_on_a_full_device_has_written_its_files(folder, tmp_path):
    page, file = tmp_path / "page.html", tmp_path / "result.json"
    flags = f"--device cpu --checkpoint {folder} --episodes 4 --duration 2 --playback {page}"
    done = shell(f"$EVAL {flags} --json {file} > /dev/full")
    assert (done.returncode, done.stderr) == (1, "eval" + ONE_LINE)
    assert json.loads(file.read_text())["episodes"] == 4 and page.stat().st_size > 1000


def test_evaluation_whose_reader_left_has_written_its_files(folder, tmp_path):
    file = tmp_path / "result.json"
    flags = f"--device cpu --checkpoint {folder} --episodes 4 --duration 2"
    done = shell(f"$EVAL {flags} --json {file} | true")
    assert (done.returncode, done.stderr) == (1, "")
    assert json.loads(file.read_text())["episodes"] == 4


@FULL
def test_an_export_on_a_full_device_is_complete(folder, tmp_path):
    flags = f"--device cpu --checkpoint {folder} --format c --out {tmp_path}"
    done = shell(f"$EXPORT {flags} > /dev/full")
    assert (done.returncode, done.stderr) == (1, "export" + ONE_LINE)
    assert len(list(tmp_path.iterdir())) == 4
