"""Paths as Orbax takes them: without what it reads as a pattern."""

import contextlib
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

PLAIN = r"[A-Za-z0-9_./ +=,@-]*"
"""Paths that Orbax takes as they are. It looks for parts of a checkpoint by patterns that begin
with the path, so that one with brackets would find none."""


@contextlib.contextmanager
def plain(path: Path) -> Iterator[Path]:
    """The path, or a link to it whose name Orbax does not take for a pattern."""
    path = path.absolute()
    if re.fullmatch(PLAIN, str(path)):
        yield path
        return
    with tempfile.TemporaryDirectory() as scratch:
        link = Path(scratch) / "folder"
        link.symlink_to(path, target_is_directory=True)
        yield link
