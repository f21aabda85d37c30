"""The folder of a training run: ``config.json``, ``metrics.csv``, a checkpoint a saved update,
and ``tensorboard/`` where it was asked for.

It belongs to one training process at a time. A process that is killed at any moment leaves a
folder that ``--resume`` goes on from: files are replaced in one step, never edited in place.
"""

import contextlib
import dataclasses
import json
import operator
import os
import shutil
from pathlib import Path

from attjax import settings, specification
from attjax.settings import Settings
from attjax.specification import LM50, Spacecraft

try:
    import fcntl
except ImportError:  # Windows, where runs are not kept apart
    fcntl = None

FORMAT = 5
CONFIG, METRICS = "config.json", "metrics.csv"
OWN_FILES = {CONFIG, METRICS, CONFIG + ".tmp", METRICS + ".tmp"}
LOST = "lost+found"
EVENTS, EVENT_FILE = "tensorboard", "events.out.tfevents.{}.attjax"
EVENT_FILES = EVENT_FILE.format("*") + "*"  # a killed process may leave one that ends in .tmp


class FolderError(Exception):
    """A run folder cannot be used; the message is one line for the user."""


@dataclasses.dataclass(frozen=True)
class Config:
    """What a run was started with.

    Raises:
        ValueError: an agent step takes longer than the spacecraft's episode.
    """

    preset: str
    seed: int
    settings: Settings
    spacecraft: Spacecraft = LM50

    def __post_init__(self):
        object.__setattr__(self, "seed", operator.index(self.seed))
        longest = max(self.settings.frameskips)
        if self.spacecraft.max_steps(longest) < 1:
            raise ValueError(
                f"frameskips holds {longest}; in {self.spacecraft.duration} s, the duration of an "
                f"episode, it must be at most {self.spacecraft.max_steps(0) - 1}"
            )


@contextlib.contextmanager
def writing(folder: Path):
    """Turn the operating system's errors into one line that names the folder."""
    try:
        yield
    except OSError as error:
        raise FolderError(f"{folder} cannot be written: {error.strerror or error}") from None


@contextlib.contextmanager
def opened(folder: Path):
    """Make the folder if there is none and keep other training processes out of it.

    The lock is the operating system's, and ends with the process, however that ends.

    Raises:
        FolderError: another process trains in it, or it is no folder that can be written.
    """
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    if fcntl is None:
        yield
        return
    with writing(folder):
        descriptor = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FolderError(
                f"{folder} is in use by another train.py; wait for it, or choose another folder"
            ) from None
        except OSError:  # a file system without locks
            pass
        yield
    finally:
        os.close(descriptor)


def holds_run(folder: Path) -> bool:
    """Whether a training run was started in the folder."""
    return (folder / CONFIG).is_file()


def create(folder: Path, config: Config, overwrite: bool) -> None:
    """Prepare a folder for a new run.

    Raises:
        FolderError: it holds a run and ``overwrite`` is false, holds only something else,
            or cannot be written. It is left as it was. Other files beside a run that is
            overwritten stay.
    """
    with writing(folder):
        if holds_run(folder):
            if not overwrite:
                raise FolderError(
                    f"{folder} holds a run already: pass --resume to continue it, "
                    f"--overwrite to replace it, or another --checkpoint"
                )
            _read_json(folder / CONFIG)
            _remove_run(folder)
        elif others := [path for path in sorted(folder.iterdir()) if _is_in_the_way(path)]:
            raise FolderError(
                f"{folder} is not empty and holds no attjax run, but {others[0].name}; "
                f"choose another folder"
            )
        else:
            _remove_run(folder)
        write_config(folder, config)


def write_config(folder: Path, config: Config) -> None:
    """Write config.json.

    Raises:
        FolderError: it cannot be written.
    """
    content = {"program": "attjax", "format": FORMAT, **dataclasses.asdict(config)}
    with writing(folder):
        replace(folder / CONFIG, json.dumps(content, indent=2) + "\n")


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
        if content["format"] != FORMAT:
            raise FolderError(
                f"{path} has format {content['format']}; this version of attjax reads {FORMAT}"
            )
        return Config(
            str(content["preset"]),
            int(content["seed"]),
            settings.from_json(content["settings"]),
            specification.from_lists(content["spacecraft"]),
        )
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise FolderError(f"{path} cannot be read: {error!r}") from None


def _read_json(path):
    try:
        content = json.loads(path.read_text())
    except (OSError, ValueError, RecursionError) as error:
        raise FolderError(f"{path} cannot be read: {error}") from None
    if not isinstance(content, dict) or content.get("program") != "attjax":
        raise FolderError(f"{path} was written by another program")
    return content


def remove_events(folder: Path) -> None:
    """Remove the event files that a run wrote; others in their folder stay."""
    for path in (folder / EVENTS).glob(EVENT_FILES):
        path.unlink()


def _is_in_the_way(path):
    """Whether it is of somebody who may not want a run beside it.

    Not so a hidden file, as of version control or a desktop, a file system's own folder, and the
    file that this process's output is redirected into.
    """
    is_hidden_file = path.name.startswith(".") and path.is_file()
    return not (_is_own(path) or is_hidden_file or path.name == LOST or _is_output(path))


def _is_output(path):
    with contextlib.suppress(OSError):  # a stream that is closed
        there = path.stat()
        return any(os.path.samestat(there, os.fstat(stream)) for stream in (1, 2))
    return False


def _is_own(path):
    """Whether nothing in it is of another program."""
    if path.name != EVENTS:
        return path.name in OWN_FILES
    return path.is_dir() and all(inner.match(EVENT_FILES) for inner in path.iterdir())


def _remove_run(folder):
    """Remove all but config.json, which a new one replaces in the end.

    A checkpoint is renamed first: half removed under its own name it would pass for a whole one.
    """
    for path in sorted(folder.iterdir()):
        if path.is_dir() and path.name.split(".")[0].isdigit():
            removed = path
            if path.name.isdigit():
                removed = path.with_name(path.name + ".removed")
                shutil.rmtree(removed, ignore_errors=True)
                path.rename(removed)
            shutil.rmtree(removed)
        elif path.name in OWN_FILES - {CONFIG}:
            path.unlink()
        elif path.name == EVENTS and path.is_dir():
            remove_events(folder)
            with contextlib.suppress(OSError):  # it holds other files, or is a link
                path.rmdir()
