"""The folder of a run: what it refuses, and that no moment of a crash leaves it unusable."""

import errno
import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from setups import CONFIG

from attjax.config import run as run_config
from attjax.config.presets import PRECISE
from attjax.runs import folder as run_folder
from attjax.runs.folder import FolderError

LATER = (
    "initial_weights",
    "kinematic_factor",
    "most_minibatches",
    "observes_quaternion_rate",
)
"""Settings that there were none of in formats 5 and 6."""

LATEST = ("actions",)
"""Settings that there were none of in format 7, either."""


def test_config_round_trip(tmp_path):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    assert run_folder.read_config(tmp_path) == CONFIG


def test_a_configuration_that_cannot_be_written_leaves_the_old_one(tmp_path, monkeypatch):
    run_folder.create(tmp_path, CONFIG, overwrite=False)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(run_folder.os, "replace", full)
    with pytest.raises(FolderError, match="No space left on device"):
        run_folder.write_config(tmp_path, run_config.Config("paper", 1, CONFIG.settings))
    assert run_folder.read_config(tmp_path) == CONFIG


def test_a_run_is_not_overwritten_unless_asked(tmp_path):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    (tmp_path / "3").mkdir()
    with pytest.raises(FolderError, match=r"--resume .* --overwrite"):
        run_folder.create(tmp_path, CONFIG, overwrite=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["3", "config.json"]


def as_format_5(folder):
    """Rewrite a run's config.json as versions did that had the settings in one table."""
    content = json.loads((folder / "config.json").read_text())
    settings = {k: x for subject in content["settings"].values() for k, x in subject.items()}
    for name in LATER + LATEST:
        del settings[name]
    content |= {"format": 5, "settings": settings}
    (folder / "config.json").write_text(json.dumps(content))


@pytest.mark.parametrize("version, missing", [(6, LATER + LATEST), (7, LATEST)])
def test_a_run_of_an_earlier_format_is_read_as_it_was_meant(tmp_path, version, missing):
    """It had no word for what was settled then."""
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    path = tmp_path / "config.json"
    content = json.loads(path.read_text())
    for subject in content["settings"].values():
        for name in missing:
            subject.pop(name, None)
    path.write_text(json.dumps(content | {"format": version}))
    assert run_folder.read_config(tmp_path) == CONFIG
    path.write_text(json.dumps(content))
    with pytest.raises(FolderError, match="missing: " + ", ".join(sorted(missing))):
        run_folder.read_config(tmp_path)


def test_a_run_of_format_5_is_read_as_it_was_meant(tmp_path):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    as_format_5(tmp_path)
    assert run_folder.read_config(tmp_path) == CONFIG
    run_folder.write_config(tmp_path, CONFIG)
    assert json.loads((tmp_path / "config.json").read_text())["format"] == run_folder.FORMAT
    assert run_folder.read_config(tmp_path) == CONFIG


def test_the_pretrained_run_is_of_format_5():
    folder = Path(__file__).parents[2] / "pretrained" / "precise"
    assert json.loads((folder / "config.json").read_text())["format"] == 5
    config = run_folder.read_config(folder)
    trained = PRECISE.replace(num_envs=2048)
    assert (config.preset, config.seed, config.settings) == ("precise", 2, trained)


def test_format_5_is_refused_where_it_is_wrong(tmp_path):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    as_format_5(tmp_path)
    path = tmp_path / "config.json"
    path.write_text(path.read_text().replace('"gae_lambda"', '"lambda"'))
    with pytest.raises(FolderError, match="gae_lambda, lambda"):
        run_folder.read_config(tmp_path)


def test_a_run_of_an_older_format_can_be_overwritten(tmp_path):
    run_folder.create(edited(tmp_path, format=1), CONFIG, overwrite=True)
    assert run_folder.read_config(tmp_path) == CONFIG


@pytest.mark.parametrize("overwrite", [False, True])
def test_folders_with_other_files_are_refused_and_kept(tmp_path, overwrite):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(FolderError, match="not empty"):
        run_folder.create(tmp_path, CONFIG, overwrite)
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_process_killed_while_it_began_leaves_a_folder_that_can_begin(tmp_path):
    (tmp_path / "config.json.tmp").write_text('{"program": "att')
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    assert run_folder.read_config(tmp_path) == CONFIG


def edited(tmp_path, **changes):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    path = tmp_path / "config.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))
    return tmp_path


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"program": "other"}, "another program"),
        ({"format": 99}, "format 99"),
        ({"settings": {}}, "unknown or missing"),
        ({"settings": 3}, "cannot be read"),
        ({"seed": None}, "cannot be read"),
    ],
)
def test_foreign_configurations_are_refused(tmp_path, changes, message):
    with pytest.raises(FolderError, match=message):
        run_folder.read_config(edited(tmp_path, **changes))


@pytest.mark.parametrize("text", ["{", "[1, 2]", "", "null", "[" * 100_000, "\x00"])
def test_files_that_are_no_configuration_are_refused(tmp_path, text):
    (tmp_path / "config.json").write_text(text)
    with pytest.raises(FolderError) as error:
        run_folder.read_config(tmp_path)
    assert "\n" not in str(error.value)


def test_only_one_process_trains_in_a_folder(tmp_path):
    script = f"""
import pathlib, sys
from attjax.runs import folder as run_folder
from attjax.config import run as run_config
with run_folder.opened(pathlib.Path({str(tmp_path)!r})):
    print("open", flush=True)
    sys.stdin.read()
"""
    other = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    with other:
        assert other.stdout.readline() == "open\n"
        with pytest.raises(FolderError, match="in use"), run_folder.opened(tmp_path):
            pass
        other.kill()
    with run_folder.opened(tmp_path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_the_lock_is_a_file_open_for_writing(tmp_path, monkeypatch):
    """As file systems on a network ask for."""
    modes = []
    monkeypatch.setattr(
        run_folder.fcntl, "flock", lambda lock, _: modes.append(fcntl.fcntl(lock, fcntl.F_GETFL))
    )
    with run_folder.opened(tmp_path):
        pass
    assert [mode & os.O_ACCMODE for mode in modes] == [os.O_RDWR]


@pytest.mark.parametrize("code", [errno.ENOLCK, errno.EOPNOTSUPP, errno.EBADF, None])
def test_a_folder_that_cannot_be_locked_is_used_and_said_to_be_unprotected(
    tmp_path, monkeypatch, capsys, code
):
    def unlockable(*_):
        raise OSError(code, os.strerror(code))

    if code is None:  # as on Windows
        monkeypatch.setattr(run_folder, "fcntl", None)
    else:
        monkeypatch.setattr(run_folder.fcntl, "flock", unlockable)
    with run_folder.opened(tmp_path):
        run_folder.create(tmp_path, CONFIG, overwrite=False)
    error = capsys.readouterr().err
    assert f"{tmp_path} is not protected from a second train.py: " in error
    assert error.count("\n") == 1


def test_a_lock_that_its_owner_removed_meanwhile_is_taken_anew(tmp_path, monkeypatch):
    flock, path = fcntl.flock, tmp_path / ".attjax-lock"

    def late(lock, how):
        flock(lock, how)
        monkeypatch.setattr(run_folder.fcntl, "flock", flock)
        path.unlink()

    monkeypatch.setattr(run_folder.fcntl, "flock", late)
    with run_folder.opened(tmp_path):
        with pytest.raises(FolderError, match="in use"), run_folder.opened(tmp_path):
            pass
        assert path.exists()
    assert not path.exists()


def test_a_folder_of_someone_else_is_left_without_a_trace(tmp_path):
    for name in (".attjax-removed", ".attjax-saving", ".attjax-replaced", ".lock"):
        (tmp_path / name).mkdir()
    (tmp_path / "metrics.csv.tmp").touch()
    before = sorted(tmp_path.iterdir())
    with pytest.raises(FolderError, match="not empty"), run_folder.opened(tmp_path):
        run_folder.create(tmp_path, CONFIG, overwrite=True)
    assert sorted(tmp_path.iterdir()) == before
