"""What flies in an evaluation: a controller, told what sensors say, or a flight loop around one."""

from collections.abc import Callable
from typing import Any, TypeAlias

import chex
import jax
import jax.numpy as jnp

from attjax.control.flight_loop import FlightLoop, Memory
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics import vectors
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.context import Context
from attjax.envs.parameters import EnvParams, EnvState, measured

Controller: TypeAlias = Callable[[chex.Array, Context], chex.Array] | FlightLoop
"""``act(observation (11,), context) -> action``; a pytree, e.g. ``jax.tree_util.Partial``.

Or one in a flight loop (:func:`attjax.flight_loop`), with an estimator and a predictor.
"""

Crew: TypeAlias = tuple[Controller, ...]
"""Controllers that fly the same slews side by side, flight loops first."""


def first_memory(controllers: Crew, context: Context, slews: int) -> Memory | None:
    """Before the first decision, of so many slews a loop; None where nothing is remembered."""
    loops = _loops(controllers)
    if not loops:
        return None
    memory, count = loops[0].init(context), slews * len(loops)
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *jnp.shape(x))), memory)


def _loops(controllers):
    return [x for x in controllers if isinstance(x, FlightLoop)]


def decide(
    controllers: Crew, context: Context, memory: Memory | None, told: chex.Array, states: Any
) -> tuple[chex.Array, Memory | None]:
    """The actions of all slews, and what is remembered after them.

    Args:
        controllers: flight loops first; each flies as many of the slews as the others.
        context: of all of them.
        memory: of the flight loops before it.
        told: (slews, 11) observations, as a controller without a loop is told.
        states: (slews,), of which a flight loop is told the measurements.
    """
    each, loops = len(told) // len(controllers), _loops(controllers)
    looped = each * len(loops)
    if loops:
        of_loops = jax.tree.map(lambda x: x[:looped], states)
        observed, memory = jax.vmap(loops[0].observed, (0, 0, None))(
            memory, jax.vmap(measured)(of_loops), context
        )
        told = jnp.concatenate([observed, told[looped:]])
    actions = []
    for n, controller in enumerate(controllers):
        part = slice(n * each, (n + 1) * each)
        if isinstance(controller, FlightLoop):
            own = jax.tree.map(lambda x, part=part: x[part], memory)
            actions.append(_by_loop(controller, own, context, told[part]))
        else:
            actions.append(jax.vmap(controller, (0, None))(told[part], context))
    action = jnp.concatenate(actions)
    if loops:
        memory = jax.vmap(loops[0].after, (0, 0, None))(memory, action[:looped], context)
    return action, memory


def _by_loop(loop, memory, context, observed):
    """The actions of a loop's controller, by what it believes of each spacecraft if it adapts."""
    if not loop.adapts:
        return jax.vmap(loop.controller, (0, None))(observed, context)
    believed = jax.vmap(loop.believed, (0, None))(memory, context)
    return jax.vmap(loop.controller)(observed, believed)


def estimated(memory: Memory | None, states: EnvState) -> chex.Array:
    """(slews, 4) attitudes that are believed at a decision; without an estimate, what was told."""
    told = jax.vmap(measured)(states).quaternion
    if memory is None:
        return told
    estimates = jnp.stack(memory.estimate.quaternion, axis=-1)
    return jnp.concatenate([estimates, told[len(estimates) :]])


def estimation_error(memory: Memory | None, states: EnvState) -> chex.Array:
    """(slews,) angle between what is believed at a decision and the truth, rad."""
    return jax.vmap(angle_between)(estimated(memory, states), states.quaternion)


def angle_between(believed: chex.Array, true: chex.Array) -> chex.Array:
    """Angle of the turn between two attitudes, (4,) quaternions of either sign, rad."""
    between = vectors.then(vectors.conjugate(tuple(believed)), tuple(true))
    return quaternions.error_angle(jnp.stack([*between[:3], jnp.abs(between[3])]))


def step(
    controllers: Crew,
    env: AttitudeEnv,
    params: EnvParams,
    moment: tuple[chex.PRNGKey, chex.Array],
    before: tuple[Memory | None, chex.Array, EnvState],
) -> tuple[Memory | None, tuple]:
    """One agent step of all slews.

    Args:
        controllers: as of :func:`decide`.
        env, params: that they fly.
        moment: the slews' keys, from which each step's is folded in, and which step it is.
        before: memory, observations (slews, 11) and states.

    Returns:
        The memory, and what ``env.step_env`` returns of each slew.
    """
    (keys, index), (memory, observation, state) = moment, before
    action, memory = decide(controllers, env.context(params), memory, observation, state)
    keys = jax.vmap(jax.random.fold_in, (0, None))(keys, index)
    return memory, jax.vmap(env.step_env, (0, 0, 0, None))(keys, state, action, params)
