"""Unit quaternions, scalar last: ``[q1, q2, q3, q_s]`` (Eq. 8).

The error quaternion relates the body frame to the desired frame; the goal is ``[0, 0, 0, 1]``.
"""

from collections.abc import Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Real

from attjax import checks
from attjax.dynamics import vectors
from attjax.dynamics.numerics import polar_angle, square_root, squared_norm, unit


def from_axis_angle(
    axis: Float[Array | np.ndarray, "3"], angle: Real[ArrayLike, ""]
) -> Float[Array, "4"]:
    """Quaternion of a rotation (Eq. 8).

    Args:
        axis: (3,) unit vector of the rotation axis.
        angle: scalar rotation angle, rad.

    Returns:
        (4,) unit quaternion, scalar last.

    Example:
        >>> from_axis_angle(jnp.array([0.0, 0.0, 1.0]), jnp.pi)[2].item()
        1.0
    """
    axis = checks.real("axis", axis, (3,))
    return jnp.append(axis * jnp.sin(angle / 2), jnp.cos(angle / 2))


def normalize(quaternion: Float[Array | np.ndarray, "4"]) -> Float[Array, "4"]:
    """Scale a (4,) quaternion to unit length."""
    return unit(quaternion)


def rotation_matrix(quaternion: Float[Array | np.ndarray, "4"]) -> Float[Array, "3 3"]:
    """The matrix that turns a vector about the axis by the angle of a (4,) unit quaternion.

    Its transpose leads from the target's components of a vector to the body's.

    Example:
        >>> quarter = from_axis_angle(jnp.array([0.0, 0.0, 1.0]), jnp.pi / 2)
        >>> [round(x.item()) for x in rotation_matrix(quarter) @ jnp.array([1.0, 0.0, 0.0])]
        [0, 1, 0]
    """
    rows = vectors.attitude_matrix(tuple(checks.real("quaternion", quaternion, (4,))))
    return jnp.stack([jnp.stack(row) for row in rows]).T


def derivative(
    quaternion: Float[Array | np.ndarray, "4 *batch"] | Sequence[Any],
    angular_velocity: Float[Array | np.ndarray, "3 *batch"] | Sequence[Any],
    factor: float = 0.5,
) -> tuple[Any, Any, Any, Any]:
    """Kinematics, q̇ = ½ Ω(ω) q (Eq. 9 and 10), by components.

    Args:
        quaternion: four components, scalar last, as an array or one by one: numbers, arrays over
            a batch, or whatever else can be added and multiplied.
        angular_velocity: three body-frame components, rad/s, likewise.
        factor: what stands in place of the ½, a Python float.

    Returns:
        Tuple of the four components of q̇, 1/s.

    Example:
        >>> [float(rate) for rate in derivative((0.0, 0.0, 0.0, 1.0), (0.2, 0.0, 0.0))]
        [0.1, 0.0, 0.0, -0.0]
    """
    q1, q2, q3, qs = quaternion
    w1, w2, w3 = angular_velocity
    return (
        factor * (w3 * q2 - w2 * q3 + w1 * qs),
        factor * (w1 * q3 - w3 * q1 + w2 * qs),
        factor * (w2 * q1 - w1 * q2 + w3 * qs),
        -factor * (w1 * q1 + w2 * q2 + w3 * q3),
    )


def turned(
    quaternion: Real[Array, "4 *batch"] | Sequence[Any],
    turn: Real[Array, "3 *batch"] | Sequence[Any],
) -> tuple[Any, Any, Any, Any]:
    """The attitude after a further turn of the body, axis times angle in its frame, rad.

    Args:
        quaternion: four components, scalar last, as an array or one by one.
        turn: three, likewise.

    Returns:
        Tuple of the four components.

    Example:
        >>> start = from_axis_angle(jnp.array([0.0, 0.0, 1.0]), 0.3)
        >>> after = jnp.stack(turned(start, jnp.array([0.0, 0.0, 0.2])))
        >>> round(rotation_vector(after)[2].item(), 6)
        0.5
    """
    half = vectors.scaled(0.5, (turn[0], turn[1], turn[2]))
    angle = square_root(vectors.dot(half, half))
    tiny = jnp.finfo(angle.dtype).tiny
    sine = jnp.where(angle > tiny, jnp.sin(angle) / jnp.maximum(angle, tiny), 1)
    a, x = vectors.scaled(sine, half), jnp.cos(angle)
    q, qs = (quaternion[0], quaternion[1], quaternion[2]), quaternion[3]
    turned = vectors.add(vectors.combined(qs, a, x, q), vectors.cross(q, a))
    return *turned, qs * x - vectors.dot(q, a)


def rotation_vector(quaternion: Float[Array | np.ndarray, "4"]) -> Float[Array, "3"]:
    """Shortest rotation as axis times angle, (3,), rad, of a (4,) quaternion.

    Example:
        >>> q = from_axis_angle(jnp.array([0.0, 1.0, 0.0]), 1.5 * jnp.pi)
        >>> round(rotation_vector(q)[1].item() / jnp.pi, 6)
        -0.5
    """
    quaternion = checks.real("quaternion", quaternion, (4,))
    sine = square_root(squared_norm(quaternion[:3]))
    half_angle = polar_angle(sine, jnp.abs(quaternion[3]))
    tiny = jnp.finfo(quaternion.dtype).tiny
    scale = jnp.where(sine > tiny, 2 * half_angle / jnp.maximum(sine, tiny), 2.0)
    return jnp.where(quaternion[3] < 0, -scale, scale) * quaternion[:3]


def error_angle(quaternion: Float[Array | np.ndarray, "4"]) -> Float[Array, ""]:
    """Rotation angle φ ∈ [0, 2π], rad, of a (4,) quaternion of any length.

    φ = 2 atan2(‖q_v‖, q_s). The arc cosine of q_s would be blind below 0.04° in float32,
    and there is no shortest-path flip: φ > π where q_s < 0, as Eq. 12 rewards q_s itself. At the
    goal, where φ has a kink, its gradient is 0.

    Example:
        >>> round(jnp.rad2deg(error_angle(jnp.array([0.0, 1e-9, 0.0, 1.0]))).item(), 10)
        1.146e-07
    """
    quaternion = checks.real("quaternion", quaternion, (4,))
    return 2 * polar_angle(square_root(squared_norm(quaternion[:3])), quaternion[3])
