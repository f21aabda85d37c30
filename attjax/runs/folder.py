"""The folder of a training run: ``config.json``, ``metrics.csv``, a checkpoint a saved update,
and ``tensorboard/`` where it was asked for.

It belongs to one training process at a time. A process that is killed at any moment leaves a
folder that ``--resume`` goes on from: files are replaced in one step, never edited in place.
"""

import contextlib
import dataclasses
import importlib
import json
import os
import re
import uuid
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

from attjax import spacecraft
from attjax.config import settings
from attjax.config.run import Config, Origin
from attjax.config.settings import FIELDS
from attjax.errors import UserError, warning_line
from attjax.runs import belongings
from attjax.world import IDEAL, World

fcntl: ModuleType | None
try:
    fcntl = importlib.import_module("fcntl")
except ImportError:  # Windows, where runs are not kept apart
    fcntl = None

FORMAT = 12
CONFIG, METRICS = belongings.CONFIG, belongings.METRICS
LOST = "lost+found"


class FolderError(UserError):
    """A run folder cannot be used; the message is one line for the user."""


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Turn the operating system's errors into one line that names the folder."""
    try:
        yield
    except OSError as error:
        raise FolderError(f"{folder} cannot be written: {error.strerror or error}") from None


@contextlib.contextmanager
def opened(folder: Path) -> Iterator[None]:
    """Make the folder if there is none and keep other training processes out of it.

    The lock is the operating system's, and ends with the process, however that ends; what the
    process was at then is cleared away at the next opening. Where there are no locks a line on
    stderr says so.

    Raises:
        FolderError: another process trains in it, or it is no folder that can be written.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        lock = _lock(folder)
    try:
        if holds_run(folder):
            with writing(folder), contextlib.suppress(FolderError):  # no run of ours: not touched
                belongings.tidy(folder, run_id(folder))
        yield
    finally:
        with contextlib.suppress(OSError):
            (folder / belongings.LOCK).unlink()
        os.close(lock)


def _lock(folder):
    """The descriptor of the lock file: open for writing, as file systems on a network need it."""
    path = folder / belongings.LOCK
    while True:
        lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if fcntl is None:
                raise OSError("this system has no locks of the kind")
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise FolderError(
                f"{folder} is in use by another train.py; wait for it, or choose another folder"
            ) from None
        except OSError as error:
            reason = f"is not protected from a second train.py: {error.strerror or error}"
            warning_line(f"{folder} {reason}")
            return lock
        # Who held it may have ended, and removed the file, since it was opened here.
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(lock), os.stat(path)):
                return lock
        os.close(lock)


def holds_run(folder: Path) -> bool:
    """Whether a training run was started in the folder."""
    return (folder / CONFIG).is_file()


def create(folder: Path, config: Config, overwrite: bool) -> None:
    """Prepare a folder for a new run.

    Raises:
        FolderError: it holds a run and ``overwrite`` is false, holds only something else,
            or cannot be written. It is left as it was. Files beside a run that is overwritten,
            and other runs' checkpoints, stay.
    """
    new = _text(config, uuid.uuid4().hex[:12])
    with writing(folder):
        if holds_run(folder):
            if not overwrite:
                raise FolderError(
                    f"{folder} holds a run already: pass --resume to continue it, "
                    f"--overwrite to replace it, or another --checkpoint"
                )
            belongings.replace_run(folder, run_id(folder), new)
        elif others := [path for path in sorted(folder.iterdir()) if _is_in_the_way(path)]:
            raise FolderError(
                f"{folder} is not empty and holds no attjax run, but {others[0].name}; "
                f"choose another folder"
            )
        else:
            replace(folder / CONFIG, new)


def run_id(folder: Path) -> str | None:
    """The id of the folder's run, which its checkpoints carry; None of an earlier version's.

    Raises:
        FolderError: config.json cannot be read.
    """
    if not holds_run(folder):
        return None
    run = _read_json(folder / CONFIG).get("run")
    if run is not None and not (isinstance(run, str) and re.fullmatch("[0-9a-f]+", run)):
        raise FolderError(f"{folder / CONFIG} cannot be read: its run is {run!r:.40}")
    return run


def write_config(folder: Path, config: Config) -> None:
    """Write the config.json of the folder's run anew.

    Raises:
        FolderError: it cannot be written.
    """
    with writing(folder):
        replace(folder / CONFIG, _text(config, run_id(folder)))


def _text(config, run):
    content = {"program": "attjax", "format": FORMAT, "run": run, **dataclasses.asdict(config)}
    content["world"] = config.world.table()
    return json.dumps(content, indent=2) + "\n"


def replace(path: Path, content: str | bytes) -> None:
    """Write a file in one step: whoever reads it finds the old content or the new one."""
    temporary = path.with_name(path.name + ".tmp")
    temporary.write_bytes(content.encode() if isinstance(content, str) else content)
    os.replace(temporary, path)


def read_config(folder: Path) -> Config:
    """What the run in the folder was started with.

    Raises:
        FolderError: the folder is missing, or holds no run of this program and format.
    """
    path = Path(folder) / CONFIG
    if not Path(folder).is_dir():
        raise FolderError(f"there is no checkpoint folder {folder}")
    if not path.is_file():
        raise FolderError(f"{folder} is no attjax checkpoint: it has no {CONFIG}")
    content = _read_json(path)
    try:
        content = UPGRADES.get(content["format"], dict)(content)
        if content["format"] != FORMAT:
            raise FolderError(
                f"{path} has format {content['format']}; this version of attjax reads {FORMAT}"
            )
        return Config(
            str(content["preset"]),
            int(content["seed"]),
            settings.from_json(content["settings"]),
            spacecraft.from_lists(content["spacecraft"]),
            World.from_lists(content["world"]),
            content["resumed_from"] and Origin(**content["resumed_from"]),
        )
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise FolderError(f"{path} cannot be read: {error!r}") from None


def _upgraded(content):
    """Up to format 11 no axis was dead; up to 10 every run began anew and learned on what is
    measured; 9 had fewer settings, 7 still fewer, and 5 had them in one table; up to 8 there was
    the ideal world only.
    """
    version, given = content["format"], content["settings"]
    if version > 5:
        given = {name: x for subject in given.values() for name, x in subject.items()}
    later = {name: f.metadata["before"] for name, f in FIELDS.items() if "before" in f.metadata}
    by_subject = dataclasses.asdict(settings.from_flat(later | given))
    world = {} if version > 8 else {"world": IDEAL.table()}
    origin = {"resumed_from": None}
    return content | world | origin | {"format": FORMAT, "settings": by_subject}


UPGRADES = dict.fromkeys(range(5, FORMAT), _upgraded)
"""What makes the content of an earlier format one of the present format."""


def _read_json(path):
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise FolderError(f"{path} cannot be read: {error}") from None
    if not isinstance(content, dict) or content.get("program") != "attjax":
        raise FolderError(f"{path} was written by another program")
    return content


def _is_in_the_way(path):
    """Whether it is of somebody who may not want a run beside it.

    Not so a hidden file, as of version control or a desktop, a file system's own folder, and the
    file that this process's output is redirected into.
    """
    is_hidden_file = path.name.startswith(".") and path.is_file()
    is_tolerated = is_hidden_file or path.name == LOST or _is_output(path)
    return not is_tolerated and path.name not in belongings.BEGUN


def _is_output(path):
    with contextlib.suppress(OSError):  # a stream that is closed
        there = path.stat()
        return any(os.path.samestat(there, os.fstat(stream)) for stream in (1, 2))
    return False
