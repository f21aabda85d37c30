"""Directions that an axis of the body must stay away from: the Sun from a star tracker, say."""

import dataclasses
from pathlib import Path
from typing import Any

from attjax.spacecraft import read_toml
from attjax.values import check_number
from attjax.world.parts import Part, check_direction


@dataclasses.dataclass(frozen=True, kw_only=True)
class KeepOut(Part):
    """A cone that an axis of the body keeps out of.

    Attributes:
        axis: of the body.
        direction: of the cone's middle, seen from the target's frame: the body's, once it has
            arrived. A direction that stays where it is among the stars stays so in it.
        half_angle_deg: the least angle between both.

    Raises:
        ValueError: a value is not as said.

    Example:
        >>> KeepOut(axis=(0, 0, 1), direction=(1, 0, 0), half_angle_deg=30).half_angle_deg
        30
    """

    axis: tuple[float, ...]
    direction: tuple[float, ...]
    half_angle_deg: float

    def __post_init__(self):
        super().__post_init__()
        check_direction("axis", self.axis)
        check_direction("direction", self.direction)
        check_number("half_angle_deg", self.half_angle_deg, 0, 179)


def from_toml(path: str | Path) -> tuple[KeepOut, ...]:
    """The cones of a TOML file, each a table ``[[keep_out]]``.

    Raises:
        OSError: it cannot be read.
        ValueError: it is no TOML, holds none, or something in it is not as said.
    """
    return from_lists(read_toml(path))


def from_lists(content: dict[str, Any]) -> tuple[KeepOut, ...]:
    """The cones that TOML or JSON made tables of.

    Raises:
        ValueError: there are none, or something in them is not as said.

    Example:
        >>> from_lists({"keep_out": [{"axis": [0, 0, 1], "direction": [1, 0, 0]}]})
        Traceback (most recent call last):
        ValueError: keep_out[1] lacks half_angle_deg
    """
    unknown = sorted(set(content) - {"keep_out"})
    if unknown:
        raise ValueError(f"{unknown[0]} is unknown; there are tables [[keep_out]]")
    tables = content.get("keep_out")
    if not isinstance(tables, list) or not tables:
        raise ValueError("there is no table [[keep_out]] in it")
    return tuple(
        KeepOut.from_table(table, f"keep_out[{number}]") for number, table in enumerate(tables, 1)
    )
