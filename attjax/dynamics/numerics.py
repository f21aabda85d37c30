"""Functions that differ from NumPy's in their gradients or in how they round."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

ARCTANGENT = (
    1.0,
    -0.3333327629200022,
    0.19998075281505315,
    -0.1426001608570026,
    0.1093234151327955,
    -0.08349724996759872,
    0.05708955633078856,
    -0.030351865114653258,
    0.010487649399874501,
    -0.0017011700903822203,
)
"""Coefficients of arctan(√t)/√t over t from 0 to 1, interpolated at Chebyshev's nodes: 3e-9."""


def unit(vector: Float[Array | np.ndarray, "n"]) -> Float[Array, "n"]:
    """Scale a vector (n,) to unit length.

    Example:
        >>> unit(jnp.array([3.0, 4.0])).tolist()
        [0.6..., 0.8...]
    """
    return jnp.divide(vector, jnp.sqrt(squared_norm(vector)))


def matmul(a: Array | np.ndarray, b: Array | np.ndarray) -> Array:
    """``jnp.matmul`` in full precision on every device: a GPU's own is of ten bits.

    Example:
        >>> matmul(jnp.eye(2), jnp.array([3.0, 4.0])).tolist()
        [3.0, 4.0]
    """
    return jnp.matmul(a, b, precision="highest")


def across(vectors: Float[Array | np.ndarray, "3 3"]) -> Float[Array, "3 3"]:
    """Of each of three vectors, rows, the cross product of the two others, in cyclic order.

    Example:
        >>> across(jnp.eye(3)).tolist()
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    a, b, c = vectors
    return jnp.stack([jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)])


def square_root(x: Float[Array | np.ndarray, "*shape"]) -> Float[Array, "*shape"]:
    """√x, element by element, with the gradient 0 where x is 0; that of the plain root is infinite.

    A norm made of it has a gradient everywhere: at the goal, and at rest, where ``jax.grad`` of
    the plain one is 0 · ∞, NaN.

    Example:
        >>> import jax
        >>> jax.grad(lambda x: square_root(jnp.sum(x**2)))(jnp.zeros(3)).tolist()
        [0.0, 0.0, 0.0]
    """
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1)), 0)


def squared_norm(vector: Float[Array | np.ndarray, "components"]) -> Float[Array, ""]:
    """The sum of the squares of a short vector's components.

    Written out: under ``vmap`` a sum along an axis of three is a loop, or a kernel, of its own.

    Example:
        >>> squared_norm(jnp.array([1.0, 2.0, 2.0])).item()
        9.0
    """
    first, *others = vector
    return functools.reduce(lambda total, x: total + x * x, others, first * first)


@jax.custom_jvp
def polar_angle(
    y: Float[Array | np.ndarray, "*shape"], x: Float[Array | np.ndarray, "*shape"]
) -> Float[Array, "*shape"]:
    """arctan2(y, x) for y ≥ 0, element by element: from 0 to π, in float32 to 2e-7 of itself.

    XLA's CPU compiler calls the C library's ``atan2f`` for each element, which takes longer than
    all else that a reward is made of; this polynomial it vectorises. Float64 has ``arctan2``.

    Example:
        >>> round(polar_angle(jnp.float32(1.0), jnp.float32(-1.0)).item() / np.pi, 6)
        0.75
    """
    if jnp.result_type(y, x) != jnp.float32:
        return jnp.arctan2(y, x)
    width = jnp.abs(x)
    longer, shorter = jnp.maximum(y, width), jnp.minimum(y, width)
    ratio = shorter / jnp.where(longer > 0, longer, 1)
    square = ratio * ratio
    polynomial = jnp.zeros_like(square)
    for coefficient in reversed(ARCTANGENT):
        polynomial = polynomial * square + coefficient
    angle = ratio * polynomial
    angle = jnp.where(y > width, jnp.pi / 2 - angle, angle)
    return jnp.where(x < 0, jnp.pi - angle, angle)


@polar_angle.defjvp
def _polar_angle_jvp(point, change):
    (y, x), (dy, dx) = point, change
    squared = x * x + y * y
    turned = jnp.where(squared > 0, x * dy - y * dx, 0)
    return polar_angle(y, x), turned / jnp.where(squared > 0, squared, 1)


def add(
    total: tuple[Float[Array | np.ndarray, "*shape"], Float[Array | np.ndarray, "*shape"]],
    x: Float[Array | np.ndarray, "*shape"],
) -> tuple[Float[Array | np.ndarray, "*shape"], Float[Array | np.ndarray, "*shape"]]:
    """Add x to a compensated sum (Kahan's).

    Args:
        total: the sum so far, and what rounding has added to it too much; zeros at first.
        x: of the same shape.

    Returns:
        The new pair. Its first part is off by two roundings, however many terms there were.

    Example:
        >>> total = (jnp.float32(2**24), jnp.float32(0))
        >>> for _ in range(3):
        ...     total = add(total, jnp.float32(1))
        >>> total[0].item() - 2**24   # 0.0 by plain addition
        4.0
    """
    so_far, excess = total
    term = x - excess
    after = so_far + term
    return after, (after - so_far) - term
