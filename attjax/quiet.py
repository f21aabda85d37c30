"""Orbax kept quiet while it is called: it prints at length what it also raises."""

import contextlib
import functools
import gc
import logging
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path

LOGGERS = ("absl", "asyncio")


@contextlib.contextmanager
def orbax() -> Iterator[None]:
    """Let Orbax neither log nor print tracebacks within the context; after it all is as before."""
    levels = {logging.getLogger(name): logging.getLogger(name).level for name in LOGGERS}
    hook = sys.unraisablehook
    for logger in levels:
        logger.setLevel(logging.CRITICAL)
    sys.unraisablehook = functools.partial(_show, hook)
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for logger, level in levels.items():
            logger.setLevel(level)


def clear_up() -> None:
    """Collect what Orbax left where it failed: it complains when that goes, not when it fails.

    To be called within the context, when the exception is gone.
    """
    gc.collect()


def _show(hook, unraisable):
    """Print no traceback of what Orbax leaves be where another array's file fails."""
    files = [frame.filename for frame in traceback.extract_tb(unraisable.exc_traceback)]
    is_orbax = any("orbax" in Path(file).parts for file in files)
    if not is_orbax and str(unraisable.exc_value) != "Event loop is closed":
        hook(unraisable)
