"""Rigid-body rotation: Euler's equations (Eq. 6), quaternion kinematics (Eq. 9), RK4.

Everything here works on one spacecraft and on scalars, one a component: under ``vmap`` each
becomes an array over the batch, which XLA vectorises several times better than arrays whose
fastest axis has length 3 or 4.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from attjax import checks, rigid_body
from attjax import quaternion as quaternions
from attjax.kernel import one_loop
from attjax.specification import INTEGRATION_STEP

PRODUCTS = ((1, 2), (2, 0), (0, 1), (0, 0), (1, 1), (2, 2))
"""The products ωⱼ ωₖ of which the gyroscopic acceleration is made."""

_LEVI_CIVITA = np.cross(np.eye(3)[:, None], np.eye(3)).transpose(2, 0, 1)

STEPS_IN_LINE = 20
"""Torque-free RK4 steps compiled for CPU one after another before there is a loop over them."""


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
        ValueError: shapes differ from the above, floating-point types are mixed, or a value is
            not finite or no inertia of a rigid body.

    Example:
        >>> q, w = rk4_step(jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3),
        ...                 jnp.array([0.872, 0.0, 0.0]), jnp.array([0.872, 0.115, 0.797]))
        >>> round(w[0].item() * 240, 6)
        1.0
    """
    quaternion, angular_velocity, torque, inertia = _checked(
        quaternion, angular_velocity, torque, inertia
    )
    state = (*quaternion, *angular_velocity)
    gyroscopic, acceleration = _euler_terms(inertia, torque)
    state = _add(state, _rk4_increment(state, gyroscopic, acceleration, dt))
    return jnp.stack(state[:4]), jnp.stack(state[4:])


def propagate(
    quaternion, angular_velocity, torque, inertia, frameskip, steps_after=None, held=False
):
    """One agent step: an RK4 step with the torque on, then ``frameskip`` torque-free ones.

    Eq. 9 is linear in q, so the one normalisation at the end equals the paper's
    normalisation after each RK4 step, up to rounding. The change is summed up apart from the
    state: float32 would lose a slow turn's small increments if each were added to the state.

    Args:
        quaternion, angular_velocity, torque, inertia: as in :func:`rk4_step`.
        frameskip: number of RK4 steps after the first, a Python integer.
        steps_after: how many of these are taken, scalar; None: all. Under ``vmap`` it lets
            spacecraft of different control rates share one program.
        held: whether the torque stays on in these steps, a Python bool.

    Returns:
        The unit quaternion (4,) and the angular velocity (3,) after (1 + frameskip)/240 s, or
        after (1 + steps_after)/240 s.
    """
    quaternion, angular_velocity, torque, inertia = _checked(
        quaternion, angular_velocity, torque, inertia
    )
    gyroscopic, acceleration = _euler_terms(inertia, torque)
    start = (*quaternion, *angular_velocity)
    limit = () if steps_after is None else (jnp.asarray(steps_after, quaternion.dtype),)
    change = _change((frameskip, held), start, acceleration, gyroscopic, limit)
    state = _add(start, change)
    return quaternions.normalize(jnp.stack(state[:4])), jnp.stack(state[4:])


def rate_after_impulse(angular_velocity, torque, inertia, duration=INTEGRATION_STEP):
    """Angular velocity after a torque that lasts for ``duration``, s, to first order.

    Args:
        angular_velocity: (3,) body-frame angular velocity, rad/s.
        torque: (..., 3) body-frame torques, N m.
        inertia: (3,) or (3, 3), kg m².

    Returns:
        (..., 3) angular velocities ω + I⁻¹ M Δt, rad/s.
    """
    if inertia.ndim == 1:
        return angular_velocity + torque / inertia * duration
    acceleration = jnp.matmul(torque, rigid_body.inverse(inertia), precision="highest")
    return angular_velocity + acceleration * duration


def _checked(quaternion, angular_velocity, torque, inertia):
    inertia = checks.inertia(inertia)
    vectors = {
        "quaternion": checks.real("quaternion", quaternion, (4,)),
        "angular_velocity": checks.real("angular_velocity", angular_velocity, (3,)),
        "torque": checks.real("torque", torque, (3,)),
    }
    for name, x in vectors.items():
        if x.dtype != inertia.dtype:
            raise ValueError(f"{name} has type {x.dtype}; it must be {inertia.dtype}, as inertia")
    return *vectors.values(), inertia


def _euler_terms(inertia, torque):
    """What Eq. 6 needs of the inertia, solved for ω̇: gyroscopic terms and I⁻¹ M, as scalars.

    With principal moments, the terms are (Iⱼ − Iₖ)/Iᵢ of each axis i, the factor of ωⱼ ωₖ. With
    a tensor they are, axis by axis, the factors of all the products in PRODUCTS.
    """
    if inertia.ndim == 1:
        i1, i2, i3 = inertia
        return ((i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3), tuple(torque / inertia)
    inverse = rigid_body.inverse(inertia)
    cross = jnp.array(_LEVI_CIVITA, inertia.dtype)
    factors = -jnp.einsum("il,ljm,mk->ijk", inverse, cross, inertia, precision="highest")
    factors = factors + factors.swapaxes(1, 2)
    terms = [[axis[j, k] / (2 if j == k else 1) for j, k in PRODUCTS] for axis in factors]
    return sum(map(tuple, terms), ()), tuple(jnp.matmul(inverse, torque, precision="highest"))


def _gyroscopic_acceleration(angular_velocity, gyroscopic):
    """−I⁻¹ (ω × Iω), from the terms of :func:`_euler_terms`."""
    products = [angular_velocity[j] * angular_velocity[k] for j, k in PRODUCTS]
    if len(gyroscopic) == 3:
        return tuple(term * product for term, product in zip(gyroscopic, products))
    axes = (gyroscopic[:6], gyroscopic[6:12], gyroscopic[12:])
    return tuple(sum(term * p for term, p in zip(axis, products)) for axis in axes)


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _change(kind, start, acceleration, gyroscopic, limit):
    """Change of the state over one agent step, compiled as is best for the device.

    ``kind`` is frameskip and held. ``limit`` is empty, or holds the number of steps to take after
    the first.
    """
    return jax.lax.platform_dependent(
        start,
        acceleration,
        gyroscopic,
        limit,
        cpu=functools.partial(_change_in_line, kind),
        default=functools.partial(_change_by_scan, kind),
    )


@_change.defjvp
def _change_jvp(kind, primals, tangents):
    return jax.jvp(functools.partial(_change_by_scan, kind), primals, tangents)


def _change_by_scan(kind, *parts):
    return _change_with(lambda function, *scalars: function(*scalars), 1, kind, *parts)


def _change_in_line(kind, *parts):
    """The same from the same functions, each RK4 step one loop over the batch."""
    return _change_with(one_loop, max(1, min(kind[0], STEPS_IN_LINE)), kind, *parts)


def _change_with(call, unroll, kind, start, acceleration, gyroscopic, limit):
    frameskip, held = kind
    later_step = functools.partial(_due_later_step if limit else _later_step, held)
    later_torque = acceleration if held else ()

    def step(change, index):
        due = (index, *limit) if limit else ()
        return call(later_step, *due, *start, *change, *later_torque, *gyroscopic), None

    change = call(_torque_step, *start, *acceleration, *gyroscopic)
    indices = jnp.arange(frameskip, dtype=start[0].dtype)
    return jax.lax.scan(step, change, indices, unroll=unroll)[0]


def _torque_step(*scalars):
    """Change of the state over one RK4 step; scalars: state (7), I⁻¹ M (3), inertia terms."""
    return _rk4_increment(scalars[:7], scalars[10:], scalars[7:10], INTEGRATION_STEP)


def _later_step(held, *scalars):
    """Change after one more RK4 step.

    Scalars: start (7), change so far (7), I⁻¹ M (3) if the torque is held, inertia terms.
    """
    start, change, later = scalars[:7], scalars[7:14], scalars[14:]
    acceleration, gyroscopic = (later[:3], later[3:]) if held else (None, later)
    state = _add(start, change)
    return _add(change, _rk4_increment(state, gyroscopic, acceleration, INTEGRATION_STEP))


def _due_later_step(held, index, limit, *scalars):
    """The same if it is one of the first ``limit`` steps, else no further change."""
    change, later = scalars[7:14], _later_step(held, *scalars)
    return tuple(jnp.where(index < limit, b, a) for a, b in zip(change, later))


def _add(state, change):
    return tuple(x + dx for x, dx in zip(state, change))


def _rk4_increment(state, gyroscopic, acceleration, dt):
    def rate(state):
        quaternion, angular_velocity = state[:4], state[4:]
        angular_acceleration = _gyroscopic_acceleration(angular_velocity, gyroscopic)
        if acceleration is not None:
            angular_acceleration = _add(angular_acceleration, acceleration)
        return *quaternions.derivative(quaternion, angular_velocity), *angular_acceleration

    def advance(dt, rates):
        return tuple(x + dt * k for x, k in zip(state, rates))

    k1 = rate(state)
    k2 = rate(advance(dt / 2, k1))
    k3 = rate(advance(dt / 2, k2))
    k4 = rate(advance(dt, k3))
    return tuple(dt / 6 * (a + 2 * (b + c) + d) for a, b, c, d in zip(k1, k2, k3, k4))
