"""The covariance of an estimate, by components: what time and measurements make of it.

A matrix is its upper triangle, row by row; what is zero in a transition or in a measurement is
None, and nothing of it is computed. No control flow on data, and arrays of fixed size: a flight
computer can do the same.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

ROUNDINGS = 8
"""Of a variance: what rounding may make of it. No measurement shrinks one by more."""

Triangle: TypeAlias = tuple[tuple[Any, ...], ...]
Row: TypeAlias = Sequence[Any]


def triangle(size: int, element: Callable[[int, int], Any]) -> Triangle:
    """The symmetric matrix whose element i, j ≥ i, the function gives."""
    return tuple(tuple(element(i, j) for j in range(i, size)) for i in range(size))


def at(matrix: Triangle, i: int, j: int) -> Any:
    """An element.

    Example:
        >>> at(((1, 2), (3,)), 1, 0)
        2
    """
    return matrix[min(i, j)][abs(i - j)]


def product(row: Row, column: Row) -> Any:
    """Σ rₖ cₖ over all k where rₖ is not None; None where there is none.

    Example:
        >>> product([2, None, 1], [3, 4, 5])
        11
    """
    total = None
    for factor, x in zip(row, column):
        if factor is not None and x is not None:
            term = x if factor is ONE else factor * x
            total = term if total is None else total + term
    return total


ONE = 1
"""In a transition or a measurement: no multiplication."""


def propagated(
    covariance: Triangle, transition: Sequence[Row], noise: Mapping[tuple[int, int], Any]
) -> Triangle:
    """F P Fᵀ + Q, of the rows of F and those elements i, j ≥ i of Q that are not zero."""
    size = len(covariance)
    columns = [[at(covariance, k, j) for k in range(size)] for j in range(size)]
    rows = [[product(row, column) for column in columns] for row in transition]

    def element(i, j):
        x = product(transition[j], rows[i])
        return x + noise[i, j] if (i, j) in noise else x

    return triangle(size, element)


def _squared(x):
    return x if x is None or x is ONE else x * x


class Scalar(NamedTuple):
    """A measured number, z = h·x + noise.

    Attributes:
        row: h.
        innovation: z, less what was expected.
        variance: of the noise.
        is_told: 1, or 0 where there is none.
    """

    row: Row
    innovation: Any
    variance: Any
    is_told: Any


def updated(
    covariance: Triangle, correction: Row, measured: Sequence[Scalar], rounding: float
) -> tuple[Triangle, Row]:
    """What measurements make of a covariance, one number after the other, and of a correction x.

    Args:
        covariance: before them.
        correction: of the estimate so far.
        measured: whose noises are independent.
        rounding: of the floating-point type, relatively.
    """
    size = len(covariance)
    kept = 1 + ROUNDINGS * rounding
    for row, innovation, variance, is_told in measured:
        column = [product(row, [at(covariance, k, j) for k in range(size)]) for j in range(size)]
        uncertain = [at(covariance, k, k) for k in range(size)]
        rounded = ROUNDINGS * rounding * product([_squared(x) for x in row], uncertain)
        share = is_told / (product(row, column) + variance + rounded)
        gain = [share * x for x in column]
        residual = innovation - product(row, correction)
        correction = [x + k * residual for x, k in zip(correction, gain)]
        covariance = _shrunk(covariance, gain, column, kept)
    return covariance, correction


def _shrunk(covariance, gain, column, kept):
    """The covariance less gain times columnᵀ."""

    def element(i, j):
        x = at(covariance, i, j)
        return (kept * x if i == j else x) - gain[i] * column[j]

    return triangle(len(covariance), element)
