"""Rigid-body rotation: Euler's equations (Eq. 6), quaternion kinematics (Eq. 9), RK4.

Everything here works on one spacecraft and on scalars, one a component: under ``vmap`` each
becomes an array over the batch, which XLA vectorises several times better than arrays whose
fastest axis has length 3 or 4.
"""

import chex
import jax
import jax.numpy as jnp

from attjax import quaternion as quaternions

INTEGRATION_STEP = 1 / 240
"""Length of one RK4 step, s (paper, section 2.3)."""

LM50_INERTIA = (0.872, 0.115, 0.797)
"""Principal moments of inertia of the LM50 bus, kg m²."""


def rk4_step(quaternion, angular_velocity, torque, inertia, dt=INTEGRATION_STEP):
    """Integrate Eq. 6 and 9 over one fourth-order Runge-Kutta step, without normalisation.

    Args:
        quaternion: (4,) error quaternion, scalar last.
        angular_velocity: (3,) body-frame angular velocity, rad/s.
        torque: (3,) body-frame external torque, constant over the step, N m.
        inertia: (3,) principal moments or (3, 3) symmetric tensor in the body frame, kg m².
        dt: step length, s.

    Returns:
        The quaternion (4,) and the angular velocity (3,) after the step.

    Raises:
        AssertionError: shapes differ from the above, or floating-point types are mixed.

    Example:
        >>> q, w = rk4_step(jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3),
        ...                 jnp.array([0.872, 0.0, 0.0]), jnp.array(LM50_INERTIA), 1 / 240)
        >>> round(w[0].item() * 240, 6)
        1.0
    """
    quaternion, angular_velocity, torque, inertia = _checked(
        quaternion, angular_velocity, torque, inertia
    )
    state = (*quaternion, *angular_velocity)
    increment = _rk4_increment(state, tuple(torque), _inertia_components(inertia), dt)
    state = _add(state, increment)
    return jnp.stack(state[:4]), jnp.stack(state[4:])


def propagate(quaternion, angular_velocity, torque, inertia, frameskip):
    """One agent step: an RK4 step with the torque on, then ``frameskip`` torque-free ones.

    Eq. 9 is linear in q, so the one normalisation at the end equals the paper's
    normalisation after each RK4 step, up to rounding. The change is summed up apart from the
    state: float32 would lose a slow turn's small increments if each were added to the state.

    Args:
        quaternion, angular_velocity, torque, inertia: as in :func:`rk4_step`.
        frameskip: number of torque-free RK4 steps, a Python integer.

    Returns:
        The unit quaternion (4,) and the angular velocity (3,) after (1 + frameskip)/240 s.
    """
    quaternion, angular_velocity, torque, inertia = _checked(
        quaternion, angular_velocity, torque, inertia
    )
    inertia = _inertia_components(inertia)
    no_torque = (jnp.zeros_like(torque[0]),) * 3

    start = (*quaternion, *angular_velocity)

    def free_step(change, _):
        increment = _rk4_increment(_add(start, change), no_torque, inertia, INTEGRATION_STEP)
        return _add(change, increment), None

    change = _rk4_increment(start, tuple(torque), inertia, INTEGRATION_STEP)
    change, _ = jax.lax.scan(free_step, change, length=frameskip)
    state = _add(start, change)
    return quaternions.normalize(jnp.stack(state[:4])), jnp.stack(state[4:])


def rate_after_impulse(angular_velocity, torque, inertia):
    """Angular velocity right after one RK4 step's worth of torque, to first order.

    Args:
        angular_velocity: (3,) body-frame angular velocity, rad/s.
        torque: (..., 3) body-frame torques, N m.
        inertia: (3,) or (3, 3), kg m².

    Returns:
        (..., 3) angular velocities ω + I⁻¹ M Δt, rad/s.
    """
    if inertia.ndim == 1:
        return angular_velocity + torque / inertia * INTEGRATION_STEP
    acceleration = jnp.matmul(torque, _inverse(inertia), precision="highest")
    return angular_velocity + acceleration * INTEGRATION_STEP


def angular_momentum(inertia, angular_velocity):
    """I ω, N m s, for an inertia (3,) or (3, 3) and (..., 3) angular velocities."""
    if inertia.ndim == 1:
        return inertia * angular_velocity
    return jnp.matmul(angular_velocity, inertia, precision="highest")


def principal_moments(inertia):
    """(3,) principal moments, kg m², of an inertia (3,) or (3, 3)."""
    return inertia if inertia.ndim == 1 else jnp.linalg.eigvalsh(inertia)


def peak_rate(angular_velocity, inertia):
    """Largest ‖ω‖ that the spacecraft comes to while it coasts on without torque.

    Coasting conserves 2T = ω·Iω and H = ‖Iω‖. In the principal axes, each
    (Iᵢ − I_min)(I_max − Iᵢ) ≥ 0, so ‖ω‖² ≤ (2T (I_min + I_max) − H²) / (I_min I_max), with
    equality where the rate about the intermediate axis passes through zero.

    Args:
        angular_velocity: (..., 3) body frame, rad/s.
        inertia: (3,) or (3, 3), kg m².

    Returns:
        (...) rad/s.

    Example: a turn about the intermediate axis is unstable and can gain 23 %.
        >>> round(peak_rate(jnp.array([0.0, 0.0, 0.4]), jnp.array(LM50_INERTIA)).item(), 4)
        0.4915
    """
    moments = principal_moments(inertia)
    low, high = jnp.min(moments), jnp.max(moments)
    momentum = angular_momentum(inertia, angular_velocity)
    complement = (low + high) * angular_velocity - momentum
    return jnp.sqrt(jnp.sum(momentum * complement, axis=-1) / (low * high))


def _checked(quaternion, angular_velocity, torque, inertia):
    arrays = [jnp.asarray(x) for x in (quaternion, angular_velocity, torque, inertia)]
    chex.assert_shape(arrays, [(4,), (3,), (3,), {1: (3,)}.get(arrays[3].ndim, (3, 3))])
    chex.assert_type(arrays, arrays[0].dtype)
    return arrays


def _inertia_components(inertia):
    """The inertia and its inverse, as a pair of (nested) tuples of scalars."""
    if inertia.ndim == 1:
        return tuple(inertia), tuple(1 / inertia)
    return tuple(map(tuple, inertia)), tuple(map(tuple, _inverse(inertia)))


def _inverse(inertia):
    """Inverse of a symmetric 3x3 matrix, by the cross products of its rows."""
    a, b, c = inertia
    adjugate = jnp.stack([jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)])
    return adjugate / jnp.sum(a * adjugate[0])


def _apply(matrix, vector):
    if not isinstance(matrix[0], tuple):
        return tuple(m * v for m, v in zip(matrix, vector))
    return tuple(sum(m * v for m, v in zip(row, vector)) for row in matrix)


def _angular_acceleration(angular_velocity, torque, inertia):
    """Eq. 6 solved for ω̇ = I⁻¹ (M − ω × Iω)."""
    tensor, inverse = inertia
    w1, w2, w3 = angular_velocity
    h1, h2, h3 = _apply(tensor, angular_velocity)
    m1, m2, m3 = torque
    return _apply(
        inverse,
        (m1 - (w2 * h3 - w3 * h2), m2 - (w3 * h1 - w1 * h3), m3 - (w1 * h2 - w2 * h1)),
    )


def _add(state, change):
    return tuple(x + dx for x, dx in zip(state, change))


def _rk4_increment(state, torque, inertia, dt):
    def rate(state):
        quaternion, angular_velocity = state[:4], state[4:]
        return (
            *quaternions.derivative(quaternion, angular_velocity),
            *_angular_acceleration(angular_velocity, torque, inertia),
        )

    def advance(dt, rates):
        return tuple(x + dt * k for x, k in zip(state, rates))

    k1 = rate(state)
    k2 = rate(advance(dt / 2, k1))
    k3 = rate(advance(dt / 2, k2))
    k4 = rate(advance(dt, k3))
    return tuple(dt / 6 * (a + 2 * (b + c) + d) for a, b, c, d in zip(k1, k2, k3, k4))
