"""Files that a program writes for its user: tried before the work, written in one step after it."""

import contextlib
import os
import uuid
from pathlib import Path

from attjax.errors import UserError


def check(flag: str, path: Path) -> None:
    """See that a flag's file can be written, and leave all as it is.

    Raises:
        UserError: it cannot.
    """
    with _one_line(flag, path):
        existed = path.exists()
        path.open("ab").close()
        if not existed:
            path.unlink()


def check_folder(flag: str, folder: Path) -> None:
    """Make a flag's folder if there is none, and see that files can be made in it.

    Raises:
        UserError: it cannot be made, or they cannot.
    """
    with _one_line(flag, folder):
        folder.mkdir(parents=True, exist_ok=True)
        trial = _unused(folder)
        trial.open("xb").close()
        trial.unlink()


@contextlib.contextmanager
def _one_line(flag, path):
    try:
        yield
    except OSError as error:
        raise UserError(f"{flag} {path} cannot be written: {error.strerror}") from None


def write(path: Path, content: str | bytes) -> None:
    """Write a file: whoever reads it, and at whatever moment this is killed, finds all or nothing.

    A link is followed. What stands for itself, such as a device or a pipe, or a file where no other
    can be made beside it, is written in place.

    Raises:
        OSError: it cannot be written. What was there is as it was.
    """
    content = content.encode() if isinstance(content, str) else content
    target = Path(os.path.realpath(path))
    if target.exists() and not (target.is_file() and os.access(target.parent, os.W_OK)):
        target.write_bytes(content)
        return
    temporary = _unused(target.parent)
    try:
        with temporary.open("xb") as file:
            file.write(content)
        if target.exists():
            temporary.chmod(target.stat().st_mode)
        os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _unused(folder):
    """A name that nobody has given to a file of theirs."""
    return folder / f".attjax-{uuid.uuid4().hex}.tmp"
