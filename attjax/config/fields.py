"""Fields of settings: what they mean and what their values may be.

This module imports nothing heavy, so that ``--help`` is instant.
"""

import dataclasses
import math
from typing import Any

from attjax.config import user_functions
from attjax.values import plain

SEED: dict[str, Any] = {"low": 0, "below": 2**32}
FRAMESKIP: dict[str, Any] = {"low": 0, "below": 10_500}
"""Limits of each, as in :func:`setting`."""

TABLE_2 = 5
"""Frameskip of the paper's Table 2, 40 Hz."""


def frameskip_to_judge(trained: tuple[int, ...] = ()) -> int:
    """Table 2's frameskip, or the trained one that is nearest to it, the quicker of two.

    Example:
        >>> frameskip_to_judge((7, 3, 20)), frameskip_to_judge()
        (3, 5)
    """
    return min(trained or [TABLE_2], key=lambda k: (abs(k - TABLE_2), k))


def setting(help: str, *, unit: str = "", symbol: str = "", group: str = "", **limits: Any) -> Any:
    """A field without default.

    Args:
        help: what it means, in a line or two.
        unit: of the number, where ``help`` does not say what it counts.
        symbol: the paper's, or the literature's.
        group: of ``GROUPS``.
        limits: ``choices``, or ``low``, ``high`` (inclusive), ``above`` and ``below``
            (exclusive), of each element where the field is a tuple, and ``most`` elements;
            ``or_function``: a user's function will do, as ``module:function``;
            ``before``: the value of runs from before there was the setting.
    """
    return dataclasses.field(
        metadata={"help": help, "unit": unit, "symbol": symbol, "group": group, **limits}
    )


GROUPS = {
    "run": "run",
    "task": "task",
    "networks": "networks",
    "ppo": "PPO",
    "logging": "logging and debugging",
}
"""Titles of the groups of settings."""


def single(name: str, kind: type, help: str, **limits: Any) -> dataclasses.Field:
    """A field, as of :func:`setting`, that belongs to no class: for :func:`check`."""
    field = setting(help, **limits)
    field.name, field.type = name, kind
    return field


@dataclasses.dataclass(frozen=True)
class Checked:
    """Fields that were made by :func:`setting`; each value is checked, and made Python's own."""

    def __post_init__(self):
        for field in dataclasses.fields(self):
            object.__setattr__(self, field.name, check(field, getattr(self, field.name)))


def check(field: dataclasses.Field, value: Any) -> Any:
    """Return a value that fits the setting, as Python's own: lists and NumPy's numbers will do.

    Raises:
        ValueError: it does not fit; the message names what is allowed.
    """
    value = plain(value)
    is_tuple = field.type == tuple[int, ...]
    kind: Any = int if is_tuple else field.type
    elements = value if is_tuple else (value,)
    fits = isinstance(elements, tuple) and 0 < len(elements) <= field.metadata.get("most", math.inf)
    if not (fits and all(_fits(kind, field.metadata, x) for x in elements)):
        name = {int: "an integer", float: "a number", bool: "true or false"}.get(kind, "")
        allowed = ["integers" if is_tuple else name, limits(field)]
        raise ValueError(f"{field.name} is {value!r}; it must be {' '.join(filter(None, allowed))}")
    return value


def _fits(kind, limits, x):
    if type(x) is not kind and not (kind is float and type(x) is int):
        return False
    if kind not in (int, float):
        is_function = limits.get("or_function", False) and user_functions.is_name(x)
        return is_function or x in limits.get("choices", (x,))
    return (
        math.isfinite(x)
        and limits.get("low", x) <= x <= limits.get("high", x)
        and limits.get("above", -math.inf) < x < limits.get("below", math.inf)
    )


def limits(field: dataclasses.Field) -> str:
    """What its values may be, beside their type; empty where there is no limit.

    Example:
        >>> limits(single("discount", float, "of later rewards", above=0, high=1))
        'above 0 and at most 1'
    """
    given = field.metadata
    if "choices" in given:
        choices = "one of " + ", ".join(given["choices"])
        return choices + (", or module:function" if "or_function" in given else "")
    words = {"low": "at least", "above": "above", "high": "at most", "below": "below"}
    described = " and ".join(f"{word} {given[k]}" for k, word in words.items() if k in given)
    return described + (f", {given['most']} of them at most" if "most" in given else "")
