"""What the tests of bad input share: how much of it, and what refusing it means."""

import contextlib
import io
from pathlib import Path

from hypothesis import HealthCheck

FUZZ = {
    "deadline": None,
    "database": None,
    "derandomize": True,
    "suppress_health_check": list(HealthCheck),
}


class Accepted(Exception):
    """The input led to the work."""


def refused(main, arguments) -> bool:
    """Call main; whether it refused, which must take one line on stderr and exit status 2."""
    output, errors = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
            main(arguments)
    except Accepted:
        return False
    except SystemExit as exit_:
        text = errors.getvalue()
        assert exit_.code == 2, (arguments, text)
        assert text.count("\n") == 1 and ": error: " in text, (arguments, text)
        assert output.getvalue() == ""
        return True
    raise AssertionError(f"{arguments} was neither refused nor accepted")


def content(folder: Path) -> dict:
    """What is in a folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }
