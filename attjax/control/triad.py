"""Three directions in space, rows of a (3, 3) matrix a, and the basis reciprocal to them."""

import chex
import jax.numpy as jnp

from attjax.dynamics.numerics import across, matmul


def shape(directions: chex.Array, inertia: chex.Array) -> chex.Array:
    """(3, 3) R I Rᵀ with the reciprocal basis R of the directions."""
    onto_axes = reciprocal(directions)
    return matmul(matmul(onto_axes, tensor(inertia)), onto_axes.T)


def tensor(inertia: chex.Array) -> chex.Array:
    """(3, 3) of an inertia (3,) or (3, 3)."""
    return jnp.diag(inertia) if inertia.ndim == 1 else inertia


def times(matrix: chex.Array, vector: chex.Array) -> chex.Array:
    """Their product, by components: of a batch, jaxlib 0.10.2 sums rows beyond 2¹⁵ numbers wrongly
    on a CPU (jax-ml/jax issue 39103).
    """
    return jnp.stack([dot(row, vector) for row in matrix])


def reciprocal(directions: chex.Array) -> chex.Array:
    """The matrix whose product with Σ pⱼ aⱼ is p."""
    rows = across(directions)
    return rows / dot(directions[0], rows[0])


def volume(directions: chex.Array) -> chex.Array:
    """What they span, negative where they are left-handed."""
    return dot(directions[0], across(directions)[0])


def dot(a: chex.Array, b: chex.Array) -> chex.Array:
    """a·b of vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
