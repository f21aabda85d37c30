"""What a spacecraft's inertia alone says of its motion."""

from typing import TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from attjax import checks
from attjax.dynamics.numerics import across, matmul, square_root

Inertia: TypeAlias = Float[Array | np.ndarray, "3"] | Float[Array | np.ndarray, "3 3"]
"""Principal moments, or a symmetric tensor in the body frame, kg m²."""


def inverse(inertia: Float[Array | np.ndarray, "3 3"]) -> Float[Array, "3 3"]:
    """Inverse of a symmetric 3x3 matrix, by the cross products of its rows."""
    adjugate = across(inertia)
    return adjugate / jnp.sum(inertia[0] * adjugate[0])


def angular_momentum(
    inertia: Inertia, angular_velocity: Float[Array | np.ndarray, "*batch 3"]
) -> Float[Array | np.ndarray, "*batch 3"]:
    """I ω, N m s, for an inertia (3,) or (3, 3) and (..., 3) angular velocities."""
    if inertia.ndim == 1:
        return inertia * angular_velocity
    return matmul(angular_velocity, inertia)


def principal_moments(inertia: Inertia) -> Float[Array, "3"]:
    """(3,) principal moments, kg m², of an inertia (3,) or (3, 3)."""
    checked = checks.inertia(inertia)
    return checked if checked.ndim == 1 else jnp.linalg.eigvalsh(checked)


def peak_rate(
    angular_velocity: Float[Array | np.ndarray, "*batch 3"], inertia: Inertia
) -> Float[Array, "*batch"]:
    """Largest ‖ω‖ that the spacecraft comes to while it coasts on without torque.

    Coasting conserves 2T = ω·Iω and H = ‖Iω‖. In the principal axes, each
    (Iᵢ − I_min)(I_max − Iᵢ) ≥ 0, so ‖ω‖² ≤ (2T (I_min + I_max) − H²) / (I_min I_max), with
    equality where the rate about the intermediate axis passes through zero. A turn about that axis
    is unstable; that of the example can gain 23 %.

    Args:
        angular_velocity: (..., 3) body frame, rad/s.
        inertia: (3,) or (3, 3), kg m².

    Returns:
        (...) rad/s.

    Example:
        >>> round(peak_rate(jnp.array([0.0, 0.0, 0.4]), jnp.array([0.872, 0.115, 0.797])).item(), 4)
        0.4915
    """
    squares = angular_velocity * matmul(angular_velocity, peak_rate_form(inertia))
    return square_root(jnp.sum(squares, axis=-1))


MOST_TURNING = 0.5**0.5
"""Of any body, ‖I⁻¹(ω × Iω)‖ ≤ √½ ‖ω‖² in the norm of :func:`peak_rate_form`."""


def peak_rate_form(inertia: Inertia) -> Float[Array, "3 3"]:
    """(3, 3) matrix A, dimensionless, of an inertia (3,) or (3, 3): peak rate² = ω·Aω.

    In the principal axes it is 1 for the least and the largest moment, and for the other, a =
    1 + (I − I_min)(I_max − I)/(I_min I_max), between 1 and 2. So √(ω·Aω) is a norm, at least ‖ω‖.
    In it the gyroscopic acceleration is at most MOST_TURNING of its square: with the factors
    (Iⱼ − Iₖ)/Iᵢ ≤ 1 and a share r of the square outside the intermediate axis, its square is at
    most a r²/4 + r (1 − r)/a ≤ ½.
    """
    moments = principal_moments(inertia)
    low, high = jnp.min(moments), jnp.max(moments)
    tensor = jnp.diag(inertia) if inertia.ndim == 1 else inertia
    squared = matmul(tensor, tensor)
    return ((low + high) * tensor - squared) / (low * high)
