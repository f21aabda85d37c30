"""Standard output and error that may fail, or lack characters: the work of a program goes on.

A reader may leave (``| head``), a disk fill up, a terminal hang up. What is printed from then on is
dropped, and the failure kept for the exit status. Where there is no Greek, symbols are spelled out.
"""

import codecs
import contextlib
import errno
import io
import os
import sys
from collections.abc import Iterator
from typing import Any

ERRORS = "attjax.plain"
"""The name of our error handler among the codecs'."""

PLAIN = {
    "γ": "gamma", "λ": "lambda", "ε": "epsilon", "φ": "phi", "ω": "omega", "θ": "theta",
    "Â": "A^", "°": "deg", "²": "^2", "½": "1/2", "‖": "|", "–": "-", "−": "-", "—": "-",
    "…": "...", "×": "x", "·": "*", "≤": "<=", "≥": ">=", "→": "->", "µ": "u", "─": "-", "━": "-",
}  # fmt: skip


class Output(io.FileIO):
    """A file descriptor to print to; its first failure is kept, not raised.

    Attributes:
        failure: the error, None before.
    """

    failure: OSError | None = None

    def write(self, data: Any, /) -> int:
        """Write, or drop what is to be written."""
        if self.failure is None:
            try:
                return super().write(data)
            except OSError as error:
                self.failure = error
        return len(data)


@contextlib.contextmanager
def guarded() -> Iterator[None]:
    """Let nothing that is printed to Python's own stdout and stderr raise, within the context.

    Streams that someone put in their place, as a notebook does, are left as they are.
    """
    _fill_gaps()
    before = sys.stdout, sys.stderr
    originals = sys.__stdout__, sys.__stderr__
    sys.stdout, sys.stderr = (
        _safe(stream, descriptor) if stream is original else stream
        for descriptor, (stream, original) in enumerate(zip(before, originals), 1)
    )
    try:
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        sys.stdout, sys.stderr = before


def _fill_gaps():
    """Open what was closed at the start: the next file opened would be printed into."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)


def _safe(stream, descriptor):
    if stream is None:  # it was closed at the start
        return io.TextIOWrapper(io.BufferedWriter(Output(descriptor, "w", closefd=False)))
    with contextlib.suppress(OSError):
        stream.flush()
    output = Output(descriptor, "w", closefd=False)
    is_unbuffered = isinstance(stream.buffer, io.RawIOBase)
    return io.TextIOWrapper(
        output if is_unbuffered else io.BufferedWriter(output),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def failure() -> OSError | None:
    """Why not all that was printed to stdout arrived, None if it did."""
    buffer = getattr(sys.stdout, "buffer", None)
    output = getattr(buffer, "raw", buffer)
    if not isinstance(output, Output):
        return None
    sys.stdout.flush()
    return output.failure


def reader_left(error: OSError) -> bool:
    """Whether it failed since nobody reads on, which is no fault."""
    return error.errno == errno.EPIPE


def print_anywhere() -> None:
    """Let stdout and stderr take any text: what their encoding lacks is written out in ASCII."""
    codecs.register_error(ERRORS, _replace)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=ERRORS)


def _replace(error):
    """A codec's error handler."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return "".join(map(_spelled, error.object[error.start : error.end])), error.end


def plain(text: str) -> str:
    """The text in ASCII.

    Example:
        >>> plain("φ ≤ 0.25°")
        'phi <= 0.25deg'
    """
    return "".join(map(_spelled, text))


def _spelled(character):
    return character if character.isascii() else PLAIN.get(character, "?")
