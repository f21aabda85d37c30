"""A user's own functions, which settings name as ``module:function``."""

import os
import pkgutil
import re
import sys
import traceback
from collections.abc import Callable
from typing import Any

from attjax.errors import UserValueError

NAME = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


class FunctionError(UserValueError):
    """A user's function cannot be used; the message is one line that names it."""


def is_name(x: object) -> bool:
    """Whether x has the form ``package.module:function``."""
    return isinstance(x, str) and NAME.fullmatch(x) is not None


def resolve(name: str) -> Callable:
    """The function of a name; its module is found as in any import, and in the current folder.

    Raises:
        FunctionError: there is no such function, or its module cannot be imported.

    Example:
        >>> resolve("math:sqrt")(9)
        3.0
    """
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        function = pkgutil.resolve_name(name)
    except Exception as error:  # importing a user's module can raise anything
        raise FunctionError(f"{name} cannot be imported: {_described(error)}") from None
    if not callable(function):
        raise FunctionError(f"{name} is {type(function).__name__}; it must be a function")
    return function


def check(name: str, call: Callable, rank: int) -> None:
    """Check what a user's function returns.

    Args:
        name: of the function, for the error.
        call: calls it, and returns something with the shape and the type of its result.
        rank: of the array of floating-point numbers that it must be: 0 or 1.

    Raises:
        FunctionError: it raises something, or returns something else.
    """
    try:
        result = call()
    except Exception as error:  # a user's function can raise anything
        raise FunctionError(f"{name} failed: {_described(error)}") from None
    shape = getattr(result, "shape", None)
    dtype: Any = getattr(result, "dtype", None)
    if shape is None or len(shape) != rank or dtype.kind != "f":
        expected = ("a scalar", "a vector")[rank]
        described = result if shape is None else f"shape {shape} and type {dtype}"
        raise FunctionError(
            f"{name} returned {described}; it must be {expected} of floating-point type"
        )


def _described(error):
    """What went wrong, and the last line of it outside of libraries."""
    first_line = str(error).strip().split("\n")[0]
    frames = traceback.extract_tb(error.__traceback__)
    own = [f for f in frames if "site-packages" not in f.filename and f.filename != __file__]
    own = [f for f in own if not f.filename.startswith(("<", os.path.dirname(os.__file__)))]
    place = f" ({os.path.basename(own[-1].filename)}, line {own[-1].lineno})" if own else ""
    return f"{type(error).__name__}: {first_line}{place}"
