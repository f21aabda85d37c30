"""Plain values that users hand in, from files or from Python: what they are, and checks of them.

This module imports nothing heavy, so that errors are instant.
"""

import math
import operator
from collections.abc import Collection
from typing import Any

LARGEST = 1e30

ACTIONS = ("discrete", "continuous")
"""How a spacecraft is steered: by one of its torques, or by any about the three axes at once."""


def plain(value: Any) -> Any:
    """Tuples for lists and arrays, Python's numbers for NumPy's: they can be hashed and written."""
    value = value.tolist() if hasattr(value, "tolist") else value
    return tuple(map(plain, value)) if isinstance(value, list | tuple) else value


def integer(x: Any) -> int | None:
    """X as Python's integer, whatever library it is an integer of; None: it is none.

    Example:
        >>> import numpy as np
        >>> integer(np.int64(20)), integer(True), integer(20.0)
        (20, None, None)
    """
    try:
        return None if isinstance(x, bool) else operator.index(x)
    except TypeError:
        return None


def check_number(name: str, x: Any, low: float, high: float) -> None:
    """Check a number.

    Raises:
        ValueError: it is none, or is not from low to high.
    """
    if not _is_number(x):
        raise ValueError(f"{name} is {shown(x)}; it must be a number")
    if not low <= x <= high:
        raise ValueError(f"{name} is {x}; it must be from {low:g} to {high:g}")


def check_share(name: str, x: Any) -> None:
    """Check a number above 0 and at most 1.

    Raises:
        ValueError: it is none.
    """
    if not (_is_number(x) and 0 < x <= 1):
        raise ValueError(f"{name} is {shown(x)}; it must be above 0 and at most 1")


def check_truth(name: str, x: Any) -> None:
    """Check a bool.

    Raises:
        ValueError: it is none.
    """
    if not isinstance(x, bool):
        raise ValueError(f"{name} is {shown(x)}; it must be True or False")


def check_numbers(
    name: str,
    values: Any,
    low: float = -math.inf,
    high: float = math.inf,
    count: int | None = None,
) -> None:
    """Check a tuple of numbers, of ``count`` if that is given.

    Raises:
        ValueError: it is none, or one of them is not from low to high.
    """
    is_tuple = isinstance(values, tuple) and values and count in (None, len(values))
    if not is_tuple or not all(map(_is_number, values)):
        listed = "a list of numbers" if count is None else f"{count} numbers"
        raise ValueError(f"{name} is {shown(values)}; it must be {listed}")
    if not all(low <= x <= high and abs(x) <= LARGEST for x in values):
        allowed = "finite" if math.isinf(high) else f"from {low:g} to {high:g}"
        raise ValueError(f"{name} is {shown(values)}; they must be {allowed}")


def check_moments(moments: Collection[float], rounding: float) -> None:
    """Check that no principal moment of inertia exceeds the other two together.

    Of no rigid body does one: each is made of the squares of two of its three coordinates.

    Args:
        moments: three numbers, in ascending order.
        rounding: of the numbers, relatively: more in a tensor of single precision, whose moments
            were computed, than in what a user wrote.

    Raises:
        ValueError: one does.
    """
    least, middle, largest = moments
    if largest > (least + middle) * (1 + rounding):
        listed = ", ".join(f"{x:g}" for x in moments)
        raise ValueError(
            f"inertia has principal moments {listed}; none may exceed the other two together"
        )


def _is_number(x):
    return isinstance(x, int | float) and not isinstance(x, bool)


def shown(values: object) -> str:
    """As in a user's file."""
    if not isinstance(values, tuple):
        return repr(values)
    return f"[{', '.join(map(shown, values))}]"


def check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    """Check that a value is one of some words.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, str) or value not in choices:
        allowed = " or ".join(map(repr, choices))
        raise ValueError(f"{name} is {value!r}; it must be {allowed}")
