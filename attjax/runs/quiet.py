"""Orbax kept quiet while it is called: it prints at length what it also raises."""

import contextlib
import functools
import logging
import re
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

import orbax.checkpoint as ocp

ORBAX = str(Path(ocp.__file__).parent)
LOGGERS = ("absl", "asyncio")


@contextlib.contextmanager
def orbax() -> Iterator[list[str]]:
    """Let Orbax neither log nor print tracebacks within the context; after it all is as before.

    But where it fails, as the caller notes in the list, other work that it had begun ends later, in
    threads and tasks of its own: what it says of them is then dropped to the end of the process.
    """
    failures: list[str] = []
    levels = {logging.getLogger(name): logging.getLogger(name).level for name in LOGGERS}
    hook = sys.unraisablehook
    for logger in levels:
        logger.setLevel(logging.CRITICAL)
    if getattr(hook, "func", None) is not _show:
        sys.unraisablehook = functools.partial(_show, hook)
    try:
        yield failures
    finally:
        if not failures:
            sys.unraisablehook = hook
        for logger, level in levels.items():
            if failures:
                logger.addFilter(_is_not_of_orbax)
            logger.setLevel(level)


def first_sentence(error: Exception) -> str:
    """What went wrong, in a line; of a long one the beginning and the end, where the cause is."""
    sentence = re.split(r"\n|\. ", str(error).strip())[0] or type(error).__name__
    return sentence if len(sentence) <= 200 else f"{sentence[:90]} … {sentence[-110:]}"


def _show(hook, unraisable):
    """Print no traceback of what Orbax leaves be where another array's file fails."""
    files = [frame.filename for frame in traceback.extract_tb(unraisable.exc_traceback)]
    is_orbax = any(ORBAX in file for file in files)
    if not is_orbax and str(unraisable.exc_value) != "Event loop is closed":
        hook(unraisable)


def _is_not_of_orbax(record):
    """Not what Orbax logs, nor what asyncio logs of a task of Orbax that nobody waited for."""
    return ORBAX not in f"{record.pathname}\n{record.getMessage()}"
