"""A filter's errors by the square root of their covariance, which rounding cannot make negative.

The errors of the rate, which is told, and those of all that its changes depend on, which is not.
"""

from typing import NamedTuple

import chex
import jax.numpy as jnp

from attjax.dynamics import vectors
from attjax.dynamics.fused_loop import together
from attjax.dynamics.numerics import matmul

PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Elements of a symmetric matrix, row by row."""


class Spread(NamedTuple):
    """Of errors S x of the response, with x of unit covariance, and A x + c of the rate.

    A square root cannot come to be of no covariance by rounding.

    Attributes:
        rate: (3, 3) covariance of c, rad²/s².
        cross: A, (3, errors).
        response: S, (errors, errors): rows of mobility, as of PAIRS, and columns.
    """

    rate: chex.Array
    cross: chex.Array
    response: chex.Array


class Seen(NamedTuple):
    """Of three rates that are told.

    Attributes:
        residual: (3,) told, less what was expected.
        variances: (3,) of their noise.
        is_told: 1, or 0 where there are none.
    """

    residual: chex.Array
    variances: chex.Array
    is_told: chex.Array


class White(NamedTuple):
    """What is told, in numbers W z whose noise, with all that is not of the response, is white.

    Attributes:
        own: (3, 3) covariance of the rate's errors that are not of the response.
        whitening: W.
        cross: Φ, (3, errors), by the errors of the response.
        inverse, half: L⁻¹ and (L + 1)⁻¹ of L Lᵀ = 1 + Φ Φᵀ.
        surprise: L⁻¹ W z, (3,).
    """

    own: chex.Array
    whitening: chex.Array
    cross: chex.Array
    inverse: chex.Array
    half: chex.Array
    surprise: chex.Array


def whitened(own: chex.Array, spread: Spread, seen: Seen) -> White:
    """What is told in white numbers; nothing of it where there is nothing.

    Args:
        own: as of :class:`White`.
        spread: of the errors before it.
        seen: what is told.
    """
    whitening, _ = _roots(own + jnp.diag(seen.variances))
    whitening = seen.is_told * whitening
    cross = matmul(whitening, spread.cross)
    inverse, half = _roots(matmul(cross, cross.T) + jnp.eye(3, dtype=own.dtype))
    residual = matmul(inverse, matmul(whitening, seen.residual))
    return White(own, whitening, cross, inverse, half, residual)


def _roots(matrix):
    """L⁻¹ and (L + 1)⁻¹ of a positive (3, 3) matrix L Lᵀ, with L lower triangular."""
    found = together(_of_root, tuple(matrix[i, j] for i, j in PAIRS))
    return [jnp.stack([jnp.stack(row) for row in x]) for x in found]


def _of_root(elements):
    xx, xy, xz, yy, yz, zz = elements
    first = jnp.sqrt(xx)
    low, side = xy / first, xz / first
    second = jnp.sqrt(yy - low * low)
    across = (yz - low * side) / second
    third = jnp.sqrt(zz - side * side - across * across)
    zero = jnp.zeros_like(xx)
    found = []
    for more in (0, 1):
        a, b, c = (1 / (x + more) for x in (first, second, third))
        corner = a * c * (low * across * b - side)
        found.append(((a, zero, zero), (-low * a * b, b, zero), (corner, -across * b * c, c)))
    return found


def updated(spread: Spread, white: White, seen: Seen) -> tuple[Spread, chex.Array, chex.Array]:
    """Spread, and errors (3,) of the rate and of the response, after the rate was told.

    With errors S x of the response and A x + c of the rate, where x is of unit covariance: x by the
    square root of Andrews (1968), and then c by what is left.

    Args:
        spread: before it.
        white, seen: what is told.
    """
    root, cross = spread.response, white.cross
    left = matmul(white.inverse.T, white.surprise)
    seen_by = matmul(root, cross.T)
    shrunk = matmul(white.inverse.T, white.half)
    back = seen.variances[:, None] * white.whitening.T
    rate = matmul(back, matmul(white.whitening, white.own))
    kept = white.half + shrunk
    told = Spread(
        rate=(rate + rate.T) / 2,
        cross=matmul(matmul(back, kept), cross),
        response=root - matmul(matmul(seen_by, shrunk), cross),
    )
    after = vectors.chosen(seen.is_told > 0, told, spread._replace(rate=white.own))
    error = seen.is_told * (seen.residual - matmul(back, left))
    return after, error, matmul(seen_by, left)


def of_wide(matrix: chex.Array) -> chex.Array:
    """A square S with S Sᵀ = M Mᵀ, of a matrix M with more columns."""
    values, axes = jnp.linalg.eigh(matmul(matrix, matrix.T))
    return axes * jnp.sqrt(jnp.maximum(values, 0))
