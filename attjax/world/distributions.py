"""Numbers that are drawn for each episode: how a description names their distribution."""

import dataclasses
import math
from typing import Any, ClassVar, TypeAlias

from attjax.values import check_number, check_numbers, shown


@dataclasses.dataclass(frozen=True)
class Uniform:
    """Any number from ``low`` to ``high``, all alike.

    Raises:
        ValueError: they are no numbers in that order.

    Example:
        >>> Uniform(0.9, 1.1).support
        (0.9, 1.1)
    """

    low: float
    high: float
    NAME: ClassVar[str] = "uniform"

    def __post_init__(self):
        _check_order(self.NAME, (self.low, self.high))

    @property
    def support(self) -> tuple[float, float]:
        """The least and the largest that it can be."""
        return self.low, self.high

    @property
    def moments(self) -> tuple[float, float]:
        """The means of it and of its square."""
        a, b = self.low, self.high
        return (a + b) / 2, (a * a + a * b + b * b) / 3


@dataclasses.dataclass(frozen=True)
class LogUniform(Uniform):
    """Any number from ``low``, above 0, to ``high``, of which all orders of magnitude are alike."""

    NAME: ClassVar[str] = "log_uniform"

    def __post_init__(self):
        super().__post_init__()
        if self.low <= 0:
            raise ValueError(f"log_uniform is {shown((self.low, self.high))}; low must be above 0")

    @property
    def moments(self) -> tuple[float, float]:
        """The means of it and of its square."""
        a, b = self.low, self.high
        decades = math.log(b / a)
        return (a, a * a) if a == b else ((b - a) / decades, (b * b - a * a) / (2 * decades))


@dataclasses.dataclass(frozen=True)
class Normal:
    """A normal distribution, cut off below ``low`` and above ``high`` where both are given.

    Raises:
        ValueError: the deviation is not above 0, or both ends are too far from the mean.

    Example:
        >>> Normal(1.0, 0.1, low=0.7, high=1.3).support
        (0.7, 1.3)
    """

    mean: float
    deviation: float
    low: float = -math.inf
    high: float = math.inf
    NAME: ClassVar[str] = "normal"

    def __post_init__(self):
        check_numbers("normal", (self.mean, self.deviation))
        if self.deviation <= 0:
            raise ValueError(f"normal has the deviation {self.deviation:g}; it must be above 0")
        if math.isinf(self.low) != math.isinf(self.high) or not self.low < self.high:
            listed = shown((self.low, self.high))
            raise ValueError(f"truncated is {listed}; it must be two numbers in rising order")
        low, high = ((x - self.mean) / self.deviation for x in (self.low, self.high))
        if not (low < MOST_DEVIATIONS and high > -MOST_DEVIATIONS):
            listed = shown((self.low, self.high))
            raise ValueError(
                f"truncated is {listed}; it must hold numbers within {MOST_DEVIATIONS} deviations "
                f"of the mean, {self.mean:g}"
            )

    @property
    def support(self) -> tuple[float, float]:
        """The least and the largest that it can be."""
        return self.low, self.high

    @property
    def moments(self) -> tuple[float, float]:
        """The means of it and of its square.

        Example:
            >>> mean, square = Normal(1.0, 0.1, low=0.9, high=1.1).moments
            >>> round(mean, 6), round((square - mean**2) ** 0.5, 6)
            (1.0, 0.053956)
        """
        mean, deviation = self.mean, self.deviation
        if math.isinf(self.low):
            return mean, mean**2 + deviation**2
        ends = [(x - mean) / deviation for x in self.support]
        heights = [math.exp(-(x**2) / 2) / math.sqrt(2 * math.pi) for x in ends]
        share = (math.erf(ends[1] / 2**0.5) - math.erf(ends[0] / 2**0.5)) / 2
        slope = (heights[0] - heights[1]) / share
        bend = (ends[0] * heights[0] - ends[1] * heights[1]) / share
        cut_mean = mean + deviation * slope
        return cut_mean, cut_mean**2 + deviation**2 * (1 + bend - slope**2)


MOST_DEVIATIONS = 4
"""A truncated normal must reach that near to its mean, or single precision could not draw it."""

Distribution: TypeAlias = Uniform | LogUniform | Normal
Number: TypeAlias = float | Distribution
"""One number, or what it is drawn from for each episode."""

KINDS = {kind.NAME: kind for kind in (Uniform, LogUniform, Normal)}
"""By the name that a description gives."""


def _check_order(name, ends):
    check_numbers(name, ends, count=2)
    if ends[0] > ends[1]:
        raise ValueError(f"{name} is {shown(ends)}; the first must be the least")


def from_table(value: Any) -> Number:
    """A number or a distribution from what TOML makes of it.

    Raises:
        ValueError: it is a table of something else.

    Example:
        >>> from_table({"normal": [1, 0.1], "truncated": [0.7, 1.3]})
        Normal(mean=1, deviation=0.1, low=0.7, high=1.3)
    """
    if not isinstance(value, dict):
        return value
    kinds = [name for name in value if name in KINDS]
    if len(kinds) != 1 or set(value) - {*kinds, "truncated"}:
        listed = ", ".join(f"{{{name} = [...]}}" for name in KINDS)
        raise ValueError(f"{_table(value)} is no distribution; there are {listed}")
    ends = _pair(kinds[0], value[kinds[0]])
    if "truncated" not in value:
        return KINDS[kinds[0]](*ends)
    if kinds[0] != Normal.NAME:
        raise ValueError(f"truncated goes with normal; {kinds[0]} ends where it says")
    return Normal(*ends, *_pair("truncated", value["truncated"]))


def _pair(name, values):
    values = tuple(values) if isinstance(values, list | tuple) else values
    check_numbers(name, values, count=2)
    return values


def _table(value):
    return "{" + ", ".join(map(repr, value)) + "}"


def to_table(number: Number) -> Any:
    """What :func:`from_table` makes that number of."""
    if isinstance(number, Uniform):
        return {number.NAME: [number.low, number.high]}
    if isinstance(number, Normal):
        table = {number.NAME: [number.mean, number.deviation]}
        cut = {} if math.isinf(number.low) else {"truncated": [number.low, number.high]}
        return table | cut
    return number


def check(name: str, number: Number, low: float, high: float) -> None:
    """Check a number, or all that a distribution can give.

    Raises:
        ValueError: it is none, or can be below ``low`` or above ``high``.
    """
    if not isinstance(number, Uniform | Normal):
        check_number(name, number, low, high)
        return
    least, most = number.support
    if not (low <= least and most <= high):
        advice = "; truncate it" if isinstance(number, Normal) else ""
        raise ValueError(
            f"{name} can be from {least:g} to {most:g}; it must be from {low:g} to {high:g}{advice}"
        )


def least(number: Number) -> float:
    """The least that it can be."""
    return number.support[0] if isinstance(number, Uniform | Normal) else number


def largest(number: Number) -> float:
    """The most that it can be."""
    return number.support[1] if isinstance(number, Uniform | Normal) else number


def moments(number: Number) -> tuple[float, float]:
    """The means of it and of its square."""
    return number.moments if isinstance(number, Uniform | Normal) else (number, number**2)


def root_mean_square(number: Number) -> float:
    """The root of its square's mean."""
    return math.sqrt(moments(number)[1])
