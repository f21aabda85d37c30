"""What in a run's folder is the run's own: only that is counted, moved or removed.

A checkpoint carries the id of its run, which config.json has, too; so a number-named folder of
someone else's, of another run even, is told apart. Runs of earlier versions have no id, nor do
their checkpoints.
"""

import contextlib
import errno
import json
import os
import re
import shutil
from pathlib import Path

CONFIG, METRICS = "config.json", "metrics.csv"
EVENTS = "tensorboard"
LOCK, SAVING = ".attjax-lock", ".attjax-saving"
REMOVED, REPLACED = ".attjax-removed", ".attjax-replaced"
"""Of a process at work: its lock, a checkpoint not yet whole, one half removed, a replaced run."""

BEGUN = {CONFIG + ".tmp", LOCK}
"""Files that a process may leave behind that was killed before it wrote config.json."""

LABEL = Path("metrics", "metrics")
BEST_BY = "terminal_error_deg"
OWN_NAME = ".attjax"
"""Ends the name of a checkpoint whose number is taken by someone else."""


def event_name(time_ns: int, run: str | None) -> str:
    """The name of a run's event file."""
    return ".".join(("events.out.tfevents", str(time_ns), *([run] if run else []), "attjax"))


def is_event(name: str, run: str | None) -> bool:
    """Whether a run wrote an event file of this name, maybe killed while it did."""
    of_run = rf"\.{re.escape(run)}" if run else ""
    return bool(re.fullmatch(rf"events\.out\.tfevents\.\d+{of_run}\.attjax(\.tmp)?", name))


def label(path: Path) -> dict:
    """What is written on a checkpoint: its run's id and its terminal error.

    Raises:
        OSError, ValueError, RecursionError: it cannot be read, or is none.
    """
    content = json.loads((path / LABEL).read_text())
    if not isinstance(content, dict) or not isinstance(content.get(BEST_BY), int | float):
        raise ValueError(f"it has no {BEST_BY}")
    return content


def write_label(path: Path, run: str | None, terminal_error: float) -> None:
    """Write on a checkpoint whose it is."""
    (path / LABEL).parent.mkdir()
    (path / LABEL).write_text(json.dumps({BEST_BY: terminal_error, "run": run}))


def checkpoints(folder: Path, run: str | None) -> dict[int, Path]:
    """A run's checkpoints by their updates, in order.

    One whose label is lost or damaged counts, so that the damage is seen; :func:`is_surely_own`
    tells whether it may be removed.

    Raises:
        OSError: the folder cannot be listed.
    """
    found = {}
    for name in sorted(os.listdir(folder)) if folder.is_dir() else ():
        number = name.removesuffix(OWN_NAME)
        path = folder / name
        if re.fullmatch("0|[1-9][0-9]*", number) and _looks_like_one(path):
            with contextlib.suppress(OSError, ValueError, RecursionError):
                if label(path).get("run") != run:
                    continue
            found[int(number)] = path
    return dict(sorted(found.items()))


def _looks_like_one(path):
    # os.path says no where it may not look, as in another user's folder.
    parts = (path / "policy" / name for name in ("_METADATA", "manifest.ocdbt"))
    return any(map(os.path.exists, parts))


def is_surely_own(path: Path, run: str | None) -> bool:
    """Whether a checkpoint's label says that the run wrote it."""
    try:
        return label(path).get("run") == run
    except (OSError, ValueError, RecursionError):
        return False


def remove(path: Path) -> None:
    """Remove a checkpoint; of a link, the link.

    It is moved first: half removed under its own name it would pass for a whole one.

    Raises:
        OSError: it cannot be removed.
    """
    if path.is_symlink():
        path.unlink()
        return
    removed = path.parent / REMOVED
    shutil.rmtree(removed, ignore_errors=True)
    removed.mkdir(exist_ok=True)
    path.rename(removed / path.name)
    shutil.rmtree(removed)


def remove_events(folder: Path, run: str | None) -> None:
    """Remove the event files that a run wrote; others in their folder stay."""
    for path in _events(folder, run):
        path.unlink()


def _events(folder, run):
    events = folder / EVENTS
    names = sorted(os.listdir(events)) if events.is_dir() else ()
    return [events / name for name in names if is_event(name, run)]


def replace_run(folder: Path, run: str | None, config: str) -> None:
    """Let a new run's config.json take the place of a run, in one step.

    The old run is moved aside while the new configuration waits beside it. When that has become
    config.json the old run is deleted; until then :func:`tidy` puts it back.

    Raises:
        OSError: something cannot be removed. All is as it was.
    """
    own = [path for path in checkpoints(folder, run).values() if is_surely_own(path, run)]
    own += [path for path in (folder / METRICS, folder / (METRICS + ".tmp")) if path.is_file()]
    if not (folder / EVENTS).is_symlink():  # that is a place of the user's, maybe on another disk
        own += _events(folder, run)
    for path in own:
        _check_removable(path)
    waiting = folder / REPLACED
    try:
        waiting.mkdir()
        (waiting / (CONFIG + ".tmp")).write_text(config)
        os.replace(waiting / (CONFIG + ".tmp"), waiting / CONFIG)
        for path in own:
            path.rename(waiting / path.name)
        os.replace(waiting / CONFIG, folder / CONFIG)
    except BaseException:
        _put_back(folder)
        raise
    shutil.rmtree(waiting, ignore_errors=True)
    with contextlib.suppress(OSError):  # there is none, it holds other files, or it is a link
        (folder / EVENTS).rmdir()


def _check_removable(path):
    """That a folder can be emptied is not seen before it is half empty, but from its modes."""
    if path.is_symlink():
        return
    for inner, _, _ in os.walk(str(path)):
        if not os.access(inner, os.R_OK | os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, f"{os.strerror(errno.EACCES)} ({inner})")


def tidy(folder: Path, run: str | None) -> None:
    """Clear away what a killed process left half done, in the locked folder of a run.

    Raises:
        OSError: a run that was to be replaced cannot be put back.
    """
    _put_back(folder)
    leftovers = [folder / SAVING, folder / REMOVED]
    if run is None:  # earlier versions left these
        pattern = r"[0-9]+\.(removed|orbax-checkpoint-tmp.*)"
        leftovers += [folder / n for n in os.listdir(folder) if re.fullmatch(pattern, n)]
    for path in leftovers:
        shutil.rmtree(path, ignore_errors=True)
    for name in (CONFIG + ".tmp", METRICS + ".tmp"):
        (folder / name).unlink(missing_ok=True)


def _put_back(folder):
    """Undo a replacement that was not completed; clear up after one that was."""
    waiting = folder / REPLACED
    if (waiting / CONFIG).is_file():
        for name in os.listdir(waiting):
            if name not in (CONFIG, CONFIG + ".tmp"):
                home = folder / EVENTS if name.startswith("events.") else folder
                (waiting / name).rename(home / name)
    shutil.rmtree(waiting, ignore_errors=True)
