"""Rigid-body rotation over an RK4 step and over an agent step, of one spacecraft."""

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Real

from attjax import checks
from attjax.dynamics import integration, rigid_body
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics.equations import EquationsOfMotion, RigidState, add
from attjax.dynamics.fused_loop import apart
from attjax.dynamics.integration import AgentStep
from attjax.dynamics.numerics import matmul
from attjax.spacecraft import INTEGRATION_STEP


def rk4_step(
    quaternion: Float[Array | np.ndarray, "4"],
    angular_velocity: Float[Array | np.ndarray, "3"],
    torque: Float[Array | np.ndarray, "3"],
    inertia: rigid_body.Inertia,
    dt: Real[ArrayLike, ""] = INTEGRATION_STEP,
    kinematic_factor: float = 0.5,
) -> tuple[Float[Array, "4"], Float[Array, "3"]]:
    """Integrate Eq. 6 and 9 over one fourth-order Runge-Kutta step, without normalisation.

    Args:
        quaternion: (4,) error quaternion, scalar last.
        angular_velocity: (3,) body-frame angular velocity, rad/s.
        torque: (3,) body-frame external torque, constant over the step, N m.
        inertia: (3,) principal moments or (3, 3) symmetric tensor in the body frame, kg m².
        dt: step length, s.
        kinematic_factor: what stands in place of Eq. 9's ½, a Python float; 1 in the authors'
            public code.

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
    start = RigidState.of(quaternion, angular_velocity)
    equations = EquationsOfMotion.of(inertia, torque, kinematic_factor)
    change = integration.rk4_increment(equations, start, dt)
    return add(start, change).vectors()


def propagate(
    quaternion: Float[Array | np.ndarray, "4"],
    angular_velocity: Float[Array | np.ndarray, "3"],
    torque: Float[Array | np.ndarray, "3"],
    inertia: rigid_body.Inertia,
    frameskip: int,
    steps_after: Real[ArrayLike, ""] | None = None,
    held: bool = False,
) -> tuple[Float[Array, "4"], Float[Array, "3"]]:
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
    agent_step = AgentStep(frameskip, held)
    return take(agent_step, quaternion, angular_velocity, torque, inertia, steps_after)


def take(
    agent_step: AgentStep,
    quaternion: Float[Array | np.ndarray, "4"],
    angular_velocity: Float[Array | np.ndarray, "3"],
    torque: Float[Array | np.ndarray, "3"],
    inertia: rigid_body.Inertia,
    steps_after: Real[ArrayLike, ""] | None = None,
    disturbance: Float[Array | np.ndarray, "3"] | None = None,
) -> tuple[Float[Array, "4"], Float[Array, "3"]]:
    """:func:`propagate`, by any kinematics.

    Args:
        agent_step: the frameskip, whether the torque is held, and the kinematics.
        quaternion, angular_velocity, torque, inertia, steps_after: as in :func:`propagate`.
        disturbance: (3,) torque that acts in all the steps, body frame, N m; None: there is none.

    Returns:
        As :func:`propagate`.
    """
    quaternion, angular_velocity, torque, inertia = _checked(
        quaternion, angular_velocity, torque, inertia
    )
    equations = EquationsOfMotion.of(inertia, apart(torque), agent_step.kinematic_factor)
    if disturbance is not None:
        disturbance = checks.real("disturbance", disturbance, (3,))
        _check_type("disturbance", disturbance, inertia)
        acceleration = rate_after_impulse(jnp.zeros_like(torque), disturbance, inertia, 1.0)
        equations = equations._replace(pushing=tuple(acceleration))
    start = RigidState.of(quaternion, angular_velocity)
    limit = None if steps_after is None else jnp.asarray(steps_after, quaternion.dtype)
    change = integration.change(agent_step, start, equations, limit)
    quaternion, rate = add(start, change).vectors()
    return quaternions.normalize(quaternion), rate


def rate_after_impulse(
    angular_velocity: Float[Array | np.ndarray, "3"],
    torque: Float[Array | np.ndarray, "*batch 3"],
    inertia: rigid_body.Inertia,
    duration: Real[ArrayLike, ""] = INTEGRATION_STEP,
) -> Float[Array | np.ndarray, "*batch 3"]:
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
    acceleration = matmul(torque, rigid_body.inverse(inertia))
    return angular_velocity + acceleration * duration


def _checked(quaternion, angular_velocity, torque, inertia):
    inertia = checks.inertia(inertia)
    vectors = {
        "quaternion": checks.real("quaternion", quaternion, (4,)),
        "angular_velocity": checks.real("angular_velocity", angular_velocity, (3,)),
        "torque": checks.real("torque", torque, (3,)),
    }
    for name, x in vectors.items():
        _check_type(name, x, inertia)
    return *vectors.values(), inertia


def _check_type(name, x, inertia):
    if x.dtype != inertia.dtype:
        raise ValueError(f"{name} has type {x.dtype}; it must be {inertia.dtype}, as inertia")
