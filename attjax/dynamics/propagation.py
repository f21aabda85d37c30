"""Rigid-body rotation over an RK4 step and over an agent step.

Everything here works on one spacecraft and on scalars, one a component: under ``vmap`` each
becomes an array over the batch, which XLA vectorises several times better than arrays whose
fastest axis has length 3 or 4. The components have their names in
:mod:`attjax.dynamics.equations`; any state is integrated whose rate the equations give.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Real

from attjax import checks
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics import rigid_body
from attjax.dynamics.equations import EquationsOfMotion, RigidState, add
from attjax.dynamics.fused_loop import apart, one_loop
from attjax.spacecraft import INTEGRATION_STEP

STEPS_TOGETHER = 7
"""RK4 steps that CPUs take in one loop over a batch: three such loops are the paper's 21."""

LOOPS_IN_LINE = 3
"""Most of those loops that are compiled one after another before there is a loop over them."""


class AgentStep(NamedTuple):
    """What is known of an agent step when it is compiled.

    Attributes:
        frameskip: number of RK4 steps after the first.
        held: whether the torque stays on in these steps.
        kinematic_factor: as in :func:`rk4_step`.
    """

    frameskip: int
    held: bool = False
    kinematic_factor: float = 0.5


class Turn(NamedTuple):
    """Which of the later RK4 steps comes next, and how many of them are taken; as floats."""

    number: Float[Array, ""]
    limit: Float[Array, ""]


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
    change = _rk4_increment(equations, start, dt)
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
) -> tuple[Float[Array, "4"], Float[Array, "3"]]:
    """:func:`propagate`, by any kinematics.

    Args:
        agent_step: the frameskip, whether the torque is held, and the kinematics.
        quaternion, angular_velocity, torque, inertia, steps_after: as in :func:`propagate`.

    Returns:
        As :func:`propagate`.
    """
    quaternion, angular_velocity, torque, inertia = _checked(
        quaternion, angular_velocity, torque, inertia
    )
    equations = EquationsOfMotion.of(inertia, apart(torque), agent_step.kinematic_factor)
    start = RigidState.of(quaternion, angular_velocity)
    limit = None if steps_after is None else jnp.asarray(steps_after, quaternion.dtype)
    change = _change(agent_step, start, equations, limit)
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


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def _change(agent_step, start, equations, limit):
    """Change of the state over one agent step, compiled as is best for the device.

    Args:
        agent_step: an AgentStep.
        start: the state; of any type whose rate the equations give.
        equations: an EquationsOfMotion, or others that have its methods.
        limit: how many of the later RK4 steps are taken; None: all.
    """
    return jax.lax.platform_dependent(
        start,
        equations,
        limit,
        cpu=functools.partial(_change_in_line, agent_step),
        default=functools.partial(_change_by_scan, agent_step),
    )


@_change.defjvp
def _change_jvp(agent_step, primals, tangents):
    return jax.jvp(functools.partial(_change_by_scan, agent_step), primals, tangents)


def _change_by_scan(agent_step, *parts):
    return _change_with(lambda function, *trees: function(*trees), (1, 1), agent_step, *parts)


def _change_in_line(agent_step, *parts):
    """The same from the same functions, several RK4 steps in each loop over the batch."""
    return _change_with(one_loop, (STEPS_TOGETHER, LOOPS_IN_LINE), agent_step, *parts)


def _change_with(call, groups_of, agent_step, start, equations, limit):
    """The change in groups of RK4 steps, the first step in the first group.

    Args:
        call: of a function and its arguments, each group's.
        groups_of: RK4 steps in a group, and groups in line.
        agent_step, start, equations, limit: as in :func:`_change`.
    """
    together, in_line = groups_of
    later_equations = equations if agent_step.held else equations.coasting()

    def later(count, number, change):
        turn = None if limit is None else Turn(number, limit)
        return call(functools.partial(_more_steps, count), turn, start, change, later_equations)

    with_first = min(together - 1, agent_step.frameskip)
    first = functools.partial(_first_steps, agent_step.held, with_first)
    change = call(first, limit, start, equations)
    groups, rest = divmod(agent_step.frameskip - with_first, together)
    numbers = with_first + together * np.arange(groups + 1, dtype=_type(start))
    change, _ = jax.lax.scan(
        lambda change, number: (later(together, number, change), None),
        change,
        numbers[:groups],
        unroll=min(max(groups, 1), in_line),
    )
    return later(rest, numbers[groups], change) if rest else change


def _type(state):
    return jnp.result_type(*jax.tree.leaves(state))


def _first_steps(held, with_first, limit, start, equations):
    change = _rk4_increment(equations, start, INTEGRATION_STEP)
    turn = None if limit is None else Turn(number=jnp.zeros_like(limit), limit=limit)
    later_equations = equations if held else equations.coasting()
    return _more_steps(with_first, turn, start, change, later_equations)


def _more_steps(count, turn, start, change, equations):
    """Change from the start after more RK4 steps, those beyond the limit left out."""
    for n in range(count):
        later = add(change, _rk4_increment(equations, add(start, change), INTEGRATION_STEP))
        if turn is not None:
            taken = turn.number + n < turn.limit
            later = jax.tree.map(functools.partial(jnp.where, taken), later, change)
        change = later
    return change


def _rk4_increment(equations, state, dt):
    def advance(dt, rates):
        return jax.tree.map(lambda x, k: x + dt * k, state, rates)

    k1 = equations.rate(state)
    k2 = equations.rate(advance(dt / 2, k1))
    k3 = equations.rate(advance(dt / 2, k2))
    k4 = equations.rate(advance(dt, k3))
    return jax.tree.map(lambda a, b, c, d: dt / 6 * (a + 2 * (b + c) + d), k1, k2, k3, k4)
