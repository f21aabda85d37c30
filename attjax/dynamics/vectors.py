"""Vectors and matrices by components: numbers, or arrays over a batch, one by one.

For what stands in a loop over RK4 steps, where JAX's arrays of three would be slow.
"""

import functools
import operator
from typing import Any, TypeAlias, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

Tree = TypeVar("Tree")
Vector: TypeAlias = tuple[Any, Any, Any]
Matrix: TypeAlias = tuple[Vector, Vector, Vector]
Quaternion: TypeAlias = tuple[Any, Any, Any, Any]


def components(tree: Any) -> Any:
    """The same tree with vectors and matrices, arrays, by components: one by one, and by rows."""

    def taken_apart(x):
        return tuple(map(taken_apart, x)) if np.ndim(x) else x

    return jax.tree.map(taken_apart, tree)


def add(tree: Tree, other: Tree) -> Tree:
    """The sum of two vectors, or of any two trees of the same structure, leaf by leaf."""
    return jax.tree.map(operator.add, tree, other)


def chosen(condition: Any, a: Tree, b: Tree) -> Tree:
    """One of two vectors, or of any two trees of the same structure."""
    return jax.tree.map(functools.partial(jnp.where, condition), a, b)


def scaled(factor: Any, a: Vector) -> Vector:
    """The product of a number and a vector."""
    return factor * a[0], factor * a[1], factor * a[2]


def combined(x: Any, a: Vector, y: Any, b: Vector) -> Vector:
    """The sum x a + y b."""
    return x * a[0] + y * b[0], x * a[1] + y * b[1], x * a[2] + y * b[2]


def dot(a: Vector, b: Vector) -> Any:
    """The inner product a·b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def unit(a: tuple[Any, ...]) -> tuple[Any, ...]:
    """The vector, of any number of components, scaled to unit length."""
    length = jnp.sqrt(sum(x * x for x in a))
    return tuple(x / length for x in a)


def cross(a: Vector, b: Vector) -> Vector:
    """The cross product a × b.

    Example:
        >>> cross((1, 0, 0), (0, 1, 0))
        (0, 0, 1)
    """
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def outer(a: Vector, b: Vector) -> Matrix:
    """The matrix a bᵀ."""
    return scaled(a[0], b), scaled(a[1], b), scaled(a[2], b)


def times(matrix: Matrix | Vector, a: Vector) -> Vector:
    """A matrix times a vector; of a diagonal matrix, three numbers.

    Args:
        matrix: three rows of three, or the diagonal.
        a: the vector.

    Example:
        >>> times((1, 2, 3), (1, 1, 1)), times(((1, 2, 0), (0, 1, 0), (0, 0, 1)), (1, 1, 1))
        ((1, 2, 3), (3, 1, 1))
    """
    if isinstance(matrix[0], tuple):
        return dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)
    return matrix[0] * a[0], matrix[1] * a[1], matrix[2] * a[2]


def sum_of_crosses(levers: Matrix, attitude: Matrix) -> Vector:
    """The sum of a × C f over all pairs whose a fᵀ make up ``levers``, with C the attitude.

    Example:
        >>> levers = outer((0, 0, 2), (1, 0, 0))
        >>> sum_of_crosses(levers, ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
        (0, 2, 0)
    """
    (m1, m2, m3), (c1, c2, c3) = levers, attitude
    return dot(m2, c3) - dot(m3, c2), dot(m3, c1) - dot(m1, c3), dot(m1, c2) - dot(m2, c1)


def attitude_matrix(quaternion: tuple) -> Matrix:
    """The matrix from the target's components of a vector to the body's.

    Args:
        quaternion: four components, scalar last, of a unit quaternion (Eq. 8).

    Example:
        >>> attitude_matrix((0, 0, 1, 0))   # half a turn about the third axis
        ((-1, 0, 0), (0, -1, 0), (0, 0, 1))
    """
    q1, q2, q3, qs = quaternion
    return (
        (1 - 2 * (q2 * q2 + q3 * q3), 2 * (q1 * q2 + qs * q3), 2 * (q1 * q3 - qs * q2)),
        (2 * (q1 * q2 - qs * q3), 1 - 2 * (q1 * q1 + q3 * q3), 2 * (q2 * q3 + qs * q1)),
        (2 * (q1 * q3 + qs * q2), 2 * (q2 * q3 - qs * q1), 1 - 2 * (q1 * q1 + q2 * q2)),
    )


def then(quaternion: Quaternion, turn: Quaternion) -> Quaternion:
    """The attitude after a further turn of the body: the product q ⊗ t, scalar last.

    Example:
        >>> then((0, 0, 1, 0), (0, 0, 1, 0))   # half a turn twice
        (0, 0, 0, -1)
    """
    v, t = quaternion[:3], turn[:3]
    vector = add(add(scaled(quaternion[3], t), scaled(turn[3], v)), cross(v, t))
    return *vector, quaternion[3] * turn[3] - dot(v, t)


def conjugate(quaternion: Quaternion) -> Quaternion:
    """The opposite turn."""
    q1, q2, q3, qs = quaternion
    return -q1, -q2, -q3, qs
