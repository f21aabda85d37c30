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


def first_memory(controller: Controller, context: Context, slews: int) -> Memory | None:
    """Of each of some slews before their first decision; None where nothing is remembered."""
    if not isinstance(controller, FlightLoop):
        return None
    memory = controller.init(context)
    return jax.tree.map(lambda x: jnp.broadcast_to(x, (slews, *jnp.shape(x))), memory)


def decide(
    controller: Controller, context: Context, memory: Memory | None, told: chex.Array, states: Any
) -> tuple[chex.Array, Memory | None]:
    """The actions of all slews, and what is remembered after them.

    Args:
        controller: of all of them.
        context: of all of them.
        memory: before it.
        told: (slews, 11) observations, as a controller without a loop is told.
        states: of which a flight loop is told the measurements.
    """
    if not isinstance(controller, FlightLoop):
        return jax.vmap(controller, (0, None))(told, context), None
    measurements = jax.vmap(measured)(states)
    return jax.vmap(controller.step, (0, 0, None))(memory, measurements, context)


def estimated(memory: Memory | None, states: EnvState) -> chex.Array:
    """(slews, 4) attitudes that are believed at a decision; without an estimate, what was told."""
    if memory is None:
        return jax.vmap(measured)(states).quaternion
    return jnp.stack(memory.estimate.quaternion, axis=-1)


def estimation_error(memory: Memory | None, states: EnvState) -> chex.Array:
    """(slews,) angle between what is believed at a decision and the truth, rad."""

    def angle(quaternion, true):
        between = vectors.then(vectors.conjugate(tuple(quaternion)), tuple(true))
        return quaternions.error_angle(jnp.stack([*between[:3], jnp.abs(between[3])]))

    return jax.vmap(angle)(estimated(memory, states), states.quaternion)


def step(
    controller: Controller,
    env: AttitudeEnv,
    params: EnvParams,
    moment: tuple[chex.PRNGKey, chex.Array],
    before: tuple[Memory | None, chex.Array, EnvState],
) -> tuple[Memory | None, tuple]:
    """One agent step of all slews.

    Args:
        controller, env, params: as of :func:`attjax.evaluation.fly`.
        moment: the slews' keys, from which each step's is folded in, and which step it is.
        before: memory, observations (slews, 11) and states.

    Returns:
        The memory, and what ``env.step_env`` returns of each slew.
    """
    (keys, index), (memory, observation, state) = moment, before
    action, memory = decide(controller, env.context(params), memory, observation, state)
    keys = jax.vmap(jax.random.fold_in, (0, None))(keys, index)
    return memory, jax.vmap(env.step_env, (0, 0, 0, None))(keys, state, action, params)
