"""Numbers, tables and comments as C and C++ read them."""

import dataclasses
import textwrap
from collections.abc import Callable
from typing import SupportsFloat

import numpy as np

NUMBERS_A_LINE = 8
COMMENT_WIDTH = 97


def number(x: SupportsFloat) -> str:
    """A constant that is exactly this float32, to the sign of a zero.

    Raises:
        ValueError: it is not finite in float32.

    Example:
        >>> number(0.1), number(-0.0), number(1e-45)
        ('0.1f', '-0.0f', '1e-45f')
    """
    with np.errstate(over="ignore"):
        single = np.float32(x)
    if not np.isfinite(single):
        raise ValueError(f"{x} is not finite in single precision")
    return str(single) + "f"


def double(x: SupportsFloat) -> str:
    """A constant that is exactly this number; NAN and INFINITY are those of math.h."""
    names = {"nan": "NAN", "inf": "INFINITY", "-inf": "-INFINITY"}
    return names.get(repr(float(x)), repr(float(x)))


def table(values: np.ndarray, form: Callable[[SupportsFloat], str] = number) -> str:
    """An initialiser of a vector, some numbers a line, or of a matrix, a row a line."""
    values = np.asarray(values)
    if values.ndim == 1:
        cuts = range(NUMBERS_A_LINE, values.size, NUMBERS_A_LINE)
        rows = [row(part, form)[1:-1] for part in np.split(values, cuts)]
    else:
        rows = [row(part, form) for part in values]
    return "{\n    " + ",\n    ".join(rows) + "}"


def row(values: np.ndarray, form: Callable[[SupportsFloat], str] = number) -> str:
    """An initialiser of a vector, in one line."""
    return "{" + ", ".join(map(form, np.asarray(values))) + "}"


def comment(text: str, indent: str = "") -> str:
    r"""Any text as lines of a C comment that is open, in ASCII, the later ones indented so.

    Nothing in it ends the comment, opens another or is a trigraph.

    Example:
        >>> comment("a */ b /* c ??/ Å")
        'a * / b / * c ? ?/ \\xc5'
    """
    plain = text.encode("ascii", "backslashreplace").decode()
    for pair in ("*/", "/*", "??"):
        while pair in plain:
            plain = plain.replace(pair, " ".join(pair))
    later = " * " + indent
    first = " " * len(later)
    lines = textwrap.wrap(plain, COMMENT_WIDTH, initial_indent=first, subsequent_indent=later)
    return "\n".join(lines).strip()


@dataclasses.dataclass(frozen=True)
class Expression:
    """Arithmetic in float32 as C text: what a Python function does to its arguments.

    The order of the operations is kept, so that C rounds as Python would.

    Attributes:
        text: the expression.
        binds: 0, a sum; 1, a product; 2, a name.

    Example:
        >>> a, b = Expression("a"), Expression("b[1]")
        >>> (-0.5 * (a * b - (b + a))).text
        '-0.5f * (a * b[1] - (b[1] + a))'
    """

    text: str
    binds: int = 2

    def __add__(self, other: "Expression") -> "Expression":
        """The sum."""
        return Expression(f"{self.text} + {other._within(1)}", 0)

    def __sub__(self, other: "Expression") -> "Expression":
        """The difference."""
        return Expression(f"{self.text} - {other._within(1)}", 0)

    def __mul__(self, other: "Expression") -> "Expression":
        """The product."""
        return Expression(f"{self._within(1)} * {other._within(2)}", 1)

    def __rmul__(self, factor: float) -> "Expression":
        """A number times this."""
        return Expression(number(factor)) * self

    def _within(self, binds):
        return self.text if self.binds >= binds else f"({self.text})"
