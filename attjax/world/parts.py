"""What the parts of a world's description have in common: checked fields, and their TOML tables."""

import dataclasses
import functools
from typing import Any, NamedTuple, Self, get_args, get_type_hints

from attjax.values import check_numbers, plain
from attjax.world import distributions


class Range(NamedTuple):
    """In a field's annotation: it holds a number or a distribution, from ``low`` to ``high``."""

    low: float
    high: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class Part:
    """A table of the description.

    Raises:
        ValueError: a value is not as its field says.
    """

    def __post_init__(self):
        kind_of_this: Any = type(self)  # mypy takes a dataclass's class for not hashable
        for field in dataclasses.fields(self):
            value = plain(getattr(self, field.name))
            object.__setattr__(self, field.name, value)
            limits, kind = _meaning(kind_of_this, field.name)
            if limits:
                distributions.check(field.name, value, *limits)
            if kind and value is not None and not isinstance(value, kind):
                raise ValueError(f"{field.name} is {value!r}; it must be a {kind.__name__}")

    @classmethod
    def from_table(cls, table: Any, name: str) -> Self:
        """The part that a TOML table describes.

        Args:
            table: what TOML or JSON made of it.
            name: of the table, for messages.

        Raises:
            ValueError: a name is unknown or missing, or a value is not as its field says.
        """
        if not isinstance(table, dict):
            raise ValueError(f"{name} is {table!r}; it must be a table")
        fields = {field.name: field for field in dataclasses.fields(cls)}
        unknown = sorted(set(table) - set(fields))
        if unknown:
            listed = ", ".join(fields)
            raise ValueError(f"{name} has the unknown name {unknown[0]!r}; there are {listed}")
        missing = [x for x, f in fields.items() if x not in table and _is_needed(f)]
        if missing:
            raise ValueError(f"{name} lacks {missing[0]}")
        values = {x: _value(cls, x, value, f"{name}.{x}") for x, value in table.items()}
        try:
            return cls(**values)
        except ValueError as error:
            raise ValueError(f"{name}.{error}") from None

    def table(self) -> dict:
        """What :meth:`from_table` makes this part of: all but what is as by default."""
        table = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value == field.default or (not _is_needed(field) and value is None):
                continue
            is_part = isinstance(value, Part)
            table[field.name] = value.table() if is_part else distributions.to_table(value)
        return table


def _is_needed(field):
    return field.default is dataclasses.MISSING


@functools.cache
def _meaning(kind, name):
    """The range of a field that holds a number, and the kind of part that a field holds."""
    annotation = get_type_hints(kind, include_extras=True)[name]
    limits = [x for x in getattr(annotation, "__metadata__", ()) if isinstance(x, Range)]
    parts = [x for x in get_args(annotation) if isinstance(x, type) and issubclass(x, Part)]
    return next(iter(limits), None), next(iter(parts), None)


def _value(owner, field, value, name):
    kind = _meaning(owner, field)[1]
    if kind:
        return kind.from_table(value, name)
    try:
        return distributions.from_table(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def check_direction(name: str, direction: Any) -> None:
    """Check three numbers that are not all zero.

    Raises:
        ValueError: they are none.
    """
    check_numbers(name, direction, count=3)
    if not any(direction):
        raise ValueError(f"{name} is all zeros; it must be a direction")
