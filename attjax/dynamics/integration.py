"""RK4 over the components of a state: one step, and an agent step as each device does it best.

Under ``vmap`` each component is an array over the batch, which XLA vectorises several times better
than arrays whose fastest axis has length 3 or 4. The components have their names in
:mod:`attjax.dynamics.equations`; any state is integrated whose rate the equations give.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Float, Real

from attjax.dynamics.equations import EquationsOfMotion, RigidState, add
from attjax.dynamics.fused_loop import one_kernel, one_loop
from attjax.spacecraft import INTEGRATION_STEP

GROUPS_IN_LINE = 3
"""Most of those groups that are compiled one after another before there is a loop over them."""


class AgentStep(NamedTuple):
    """What is known of an agent step when it is compiled.

    Attributes:
        frameskip: number of RK4 steps after the first.
        held: whether the torque stays on in these steps.
        kinematic_factor: what stands in place of Eq. 9's ½.
    """

    frameskip: int
    held: bool = False
    kinematic_factor: float = 0.5


class Turn(NamedTuple):
    """Which of the later RK4 steps comes next, and how many are taken, None: all; as floats."""

    number: Float[Array | np.ndarray, ""]
    limit: Float[Array, ""] | None


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def change(
    agent_step: AgentStep,
    start: RigidState,
    equations: EquationsOfMotion,
    limit: Float[Array, ""] | None,
) -> RigidState:
    """Change of the state over one agent step, compiled as is best for the device.

    Args:
        agent_step: what is known of it.
        start: the state; of any type whose rate the equations give.
        equations: of motion; of any type that has the methods of :class:`EquationsOfMotion`.
        limit: how many of the later RK4 steps are taken; None: all.
    """
    return jax.lax.platform_dependent(
        start,
        equations,
        limit,
        cpu=functools.partial(change_in_groups, one_loop, agent_step),
        cuda=functools.partial(change_in_groups, one_kernel, agent_step),
        default=functools.partial(change_by_scan, agent_step),
    )


@change.defjvp
def _change_jvp(agent_step, primals, tangents):
    return jax.jvp(functools.partial(change_by_scan, agent_step), primals, tangents)


def change_by_scan(agent_step: AgentStep, *parts: Any) -> RigidState:
    """As :func:`change`, an RK4 step after the other."""
    return _change_with(lambda function, *trees: function(*trees), (1, 1), agent_step, *parts)


def change_in_groups(call: Callable, agent_step: AgentStep, *parts: Any) -> RigidState:
    """As :func:`change`, from the same functions, several RK4 steps at a time.

    Args:
        call: :func:`one_loop` or :func:`one_kernel`.
        agent_step, parts: as of :func:`change`.
    """
    _, equations, _ = parts
    return _change_with(call, (equations.steps_together, GROUPS_IN_LINE), agent_step, *parts)


def _change_with(call, groups_of, agent_step, start, equations, limit):
    """The change in groups of RK4 steps, the first step in the first group.

    Args:
        call: of a function and its arguments, each group's.
        groups_of: RK4 steps in a group, and groups in line.
        agent_step, start, equations, limit: as in :func:`change`.
    """
    together, in_line = groups_of
    later_equations = equations if agent_step.held else equations.coasting()
    is_counted = limit is not None or equations.is_timed

    def later(count, number, change):
        turn = Turn(number, limit) if is_counted else None
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
    first = np.zeros((), _type(start))
    change = rk4_increment(equations.during(first, start), start, INTEGRATION_STEP)
    change = equations.after(first, change)
    is_counted = limit is not None or equations.is_timed
    turn = Turn(first, limit) if is_counted else None
    later_equations = equations if held else equations.coasting()
    return _more_steps(with_first, turn, start, change, later_equations)


def _more_steps(count, turn, start, change, equations):
    """Change from the start after more RK4 steps, those beyond the limit left out."""
    for n in range(count):
        turn_of_n = None if turn is None else turn._replace(number=turn.number + n)
        change = _later_step(turn_of_n, start, change, equations)
    return change


@jax.jit
def _later_step(turn, start, change, equations):
    """One of them; jitted so that it is traced once for all."""
    number, state = None if turn is None else turn.number + 1, add(start, change)
    increment = rk4_increment(equations.during(number, state), state, INTEGRATION_STEP)
    later = equations.after(number, add(change, increment))
    if turn is None or turn.limit is None:
        return later
    is_taken = turn.number < turn.limit
    return jax.tree.map(functools.partial(jnp.where, is_taken), later, change)


def rk4_increment(
    equations: EquationsOfMotion, state: RigidState, dt: Real[ArrayLike, ""]
) -> RigidState:
    """Change of the state over one fourth-order Runge-Kutta step of length dt, s."""

    def advance(dt, rates):
        return jax.tree.map(lambda x, k: x + dt * k, state, rates)

    k1 = equations.rate(state)
    k2 = equations.rate(advance(dt / 2, k1))
    k3 = equations.rate(advance(dt / 2, k2))
    k4 = equations.rate(advance(dt, k3))
    return jax.tree.map(lambda a, b, c, d: dt / 6 * (a + 2 * (b + c) + d), k1, k2, k3, k4)
