"""How the programs fail: one line on stderr, and an exit status."""

import contextlib
import contextvars
import functools
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import NoReturn

from attjax import streams

OUTPUT_FAILED, BAD_INPUT = 1, 2

Main = Callable[..., int]


class UserError(Exception):
    """Bad input; the message is one line that names what is wrong and what is allowed.

    What users can put right is of this class, or of one derived from it, wherever it is found.
    """


class UserValueError(UserError, ValueError):
    """A value that users can put right, and that a library's user expects as a ValueError."""


_running = contextvars.ContextVar("_running", default="attjax")


def running() -> str:
    """The name of the program that runs; its lines on stderr begin with it."""
    return _running.get()


def program(name: str) -> Callable[[Main], Main]:
    """Make a function a program: it prints anywhere, and goes on where printing fails.

    Done all the same, it returns 1 instead of 0, with a line on stderr unless its reader left.
    Interrupted from the keyboard it returns 130. ``prog`` gives it another name.
    """

    def decorate(main):
        @functools.wraps(main)
        def command(argv: Sequence[str] | None = None, prog: str = name) -> int:
            with _named(prog), streams.guarded():
                streams.print_anywhere()
                return _status(main, argv)

        return command

    return decorate


@contextlib.contextmanager
def _named(name):
    token = _running.set(name)
    try:
        yield
    finally:
        _running.reset(token)


def _status(main, argv):
    """The exit status of a program, and of its output."""
    try:
        status = main(argv)
    except KeyboardInterrupt:  # training hears it itself
        error_line("interrupted")
        status = 128 + signal.SIGINT
    except SystemExit as exit_:  # of --help, or of bad input
        if exit_.code or not streams.failure():
            raise
        status = 0
    failure = streams.failure()
    if status or failure is None:
        return status
    if not streams.reader_left(failure):
        error_line(f"all is done, but stdout failed: {failure.strerror}")
    return OUTPUT_FAILED


@contextlib.contextmanager
def one_line_errors(*kinds: type[Exception]) -> Iterator[None]:
    """Turn a :class:`UserError`, exceptions of these kinds and what the system says of a file into
    one line on stderr and exit status 2.
    """
    told: tuple[type[Exception], ...] = (UserError, *kinds)
    try:
        yield
    except told as error:
        fail(error)
    except OSError as error:  # a folder that may not be entered, a name that is too long, ...
        if error.filename is None:
            raise
        fail(f"{error.filename}: {error.strerror}")


def error_line(message: object) -> None:
    """Print the message as one line on stderr."""
    print(f"{running()}: error: {' '.join(str(message).split())}", file=sys.stderr)


def warning_line(message: object) -> None:
    """Print a warning on stderr."""
    print(f"{running()}: warning: {message}", file=sys.stderr)


def fail(message: object) -> NoReturn:
    """Print the message as one line on stderr and exit with BAD_INPUT."""
    error_line(message)
    sys.exit(BAD_INPUT)


@contextlib.contextmanager
def enough_memory(advice: str) -> Iterator[None]:
    """Turn JAX's errors about memory into a :class:`UserError` with this advice."""
    try:
        yield
    except RuntimeError as error:
        if "RESOURCE_EXHAUSTED" not in str(error):
            raise
        raise UserError(f"the memory does not suffice; {advice}") from None
