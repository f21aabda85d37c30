"""The paper's state vector (Eq. 11)."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from attjax import checks
from attjax.dynamics import quaternion as quaternions

SIZE = 11
QUATERNION = slice(0, 4)
ANGULAR_VELOCITY = slice(8, 11)


def observe(
    quaternion: Float[Array | np.ndarray, "4"],
    angular_velocity: Float[Array | np.ndarray, "3"],
    kinematic_factor: float = 0.5,
    shows_rate: bool = True,
) -> Float[Array, "11"]:
    """Eq. 11: error quaternion, its rate and the angular velocity.

    Args:
        quaternion: (4,) error quaternion, scalar last.
        angular_velocity: (3,) body frame, rad/s.
        kinematic_factor: what stands in place of Eq. 9's ½, a Python float.
        shows_rate: whether q̇ is told, a Python bool; where not, zeros stand in its place.

    Returns:
        (11,) vector [q (4), q̇ (4, 1/s), ω (3, rad/s)].

    Example:
        >>> observe(jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.array([0.5, 0.0, 0.0]))[4].item()
        0.25
    """
    quaternion = checks.real("quaternion", quaternion, (4,))
    angular_velocity = checks.real("angular_velocity", angular_velocity, (3,))
    if shows_rate:
        rate = jnp.stack(quaternions.derivative(quaternion, angular_velocity, kinematic_factor))
    else:
        rate = jnp.zeros_like(quaternion)
    return jnp.concatenate([quaternion, rate, angular_velocity])
