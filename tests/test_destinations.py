"""Files for the user: whole or not at all, and nobody else's touched."""

import os
import signal

import pytest
from commands import eval_script

from attjax import destinations
from attjax.errors import UserError
from attjax.evaluation import summary


def test_a_write_that_fails_leaves_what_was_there(tmp_path, monkeypatch):
    path = tmp_path / "result.json"
    path.write_text("old")
    neighbour = tmp_path / "result.json.tmp"
    neighbour.write_text("the user's")

    def full(*_):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full)
        with pytest.raises(OSError, match="No space"):
            destinations.write(path, "new")
    assert path.read_text() == "old" and neighbour.read_text() == "the user's"
    path.chmod(0o640)
    destinations.write(path, "new")
    assert path.read_text() == "new" and path.stat().st_mode & 0o777 == 0o640
    assert sorted(p.name for p in tmp_path.iterdir()) == ["result.json", "result.json.tmp"]


def test_links_are_followed_and_pipes_written_to(tmp_path):
    real = tmp_path / "real.json"
    link = tmp_path / "link.json"
    link.symlink_to(real)
    destinations.write(link, "through")
    assert link.is_symlink() and real.read_text() == "through"
    destinations.write(tmp_path / "null", "x")
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    destinations.check("--json", tmp_path / "pipe")
    destinations.write(tmp_path / "pipe", "flows")
    assert os.read(reader, 9) == b"flows"
    os.close(reader)


def test_checks_leave_nothing_behind(tmp_path):
    (tmp_path / "a.tmp").write_text("the user's")
    destinations.check("--json", tmp_path / "a")
    destinations.check_folder("--out", tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["a.tmp"]
    with pytest.raises(UserError, match=r"--json .*nowhere/a cannot be written: No such file"):
        destinations.check("--json", tmp_path / "nowhere" / "a")


def test_an_interrupted_evaluation_ends_in_a_line(monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(summary, "fly", interrupted)
    arguments = ["--controller", "feedback", "--device", "cpu", "--episodes", "1"]
    assert eval_script.main(arguments) == 128 + signal.SIGINT
    assert capsys.readouterr().err == "eval.py: error: interrupted\n"
