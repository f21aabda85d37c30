"""How the programs fail: one line on stderr, and an exit status."""

import contextlib
import functools
import signal
import sys

from attjax import streams

OUTPUT_FAILED, BAD_INPUT = 1, 2


class UserError(Exception):
    """Bad input; the message is one line that names what is wrong and what is allowed.

    What users can put right is of this class, or of one derived from it, wherever it is found.
    """


def program(name: str):
    """Make a function a command: it prints anywhere, and goes on where printing fails.

    Done all the same, it returns 1 instead of 0, with a line on stderr unless its reader left.
    Interrupted from the keyboard it returns 130.
    """

    def decorate(main):
        @functools.wraps(main)
        def command(argv=None) -> int:
            with streams.guarded():
                streams.print_anywhere()
                try:
                    status = main(argv)
                except KeyboardInterrupt:  # training hears it itself
                    error_line(name, "interrupted")
                    status = 128 + signal.SIGINT
                except SystemExit as exit_:  # of --help, or of bad input
                    if exit_.code or not streams.failure():
                        raise
                    status = 0
                failure = streams.failure()
                if status or failure is None:
                    return status
                if not streams.reader_left(failure):
                    error_line(name, f"all is done, but stdout failed: {failure.strerror}")
                return OUTPUT_FAILED

        return command

    return decorate


@contextlib.contextmanager
def one_line_errors(prog: str, *kinds: type[Exception]):
    """Turn a :class:`UserError`, exceptions of these kinds and what the system says of a file into
    one line on stderr and exit status 2.
    """
    try:
        yield
    except (UserError, *kinds) as error:
        fail(prog, error)
    except OSError as error:  # a folder that may not be entered, a name that is too long, ...
        if error.filename is None:
            raise
        fail(prog, f"{error.filename}: {error.strerror}")


def error_line(prog: str, message) -> None:
    """Print the message as one line on stderr."""
    print(f"{prog}: error: {' '.join(str(message).split())}", file=sys.stderr)


def fail(prog: str, message):
    """Print the message as one line on stderr and exit with BAD_INPUT."""
    error_line(prog, message)
    sys.exit(BAD_INPUT)


@contextlib.contextmanager
def enough_memory(advice: str):
    """Turn JAX's errors about memory into a :class:`UserError` with this advice."""
    try:
        yield
    except RuntimeError as error:
        if "RESOURCE_EXHAUSTED" not in str(error):
            raise
        raise UserError(f"the memory does not suffice; {advice}") from None
