"""What flies in an evaluation: a controller, told what sensors say, or a flight loop around one."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import chex
import jax
import jax.numpy as jnp

from attjax.control.flight_loop import FlightLoop
from attjax.control.memory import Memory
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics import vectors
from attjax.envs import parameters
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.context import Context
from attjax.envs.parameters import EnvParams, EnvState, measured

Controller: TypeAlias = Callable[[chex.Array, Context], chex.Array] | FlightLoop
"""``act(observation (11,), context) -> action``; a pytree, e.g. ``jax.tree_util.Partial``.

Or one in a flight loop (:func:`attjax.flight_loop`), with an estimator and a predictor.
"""

Crew: TypeAlias = tuple[Controller, ...]
"""Controllers that fly the same slews side by side, flight loops first."""


class Flown(NamedTuple):
    """What is flown.

    Attributes:
        env: the simulator.
        params: its parameters; those in which the slews' spacecraft differ have a leading axis
            (slews,).
    """

    env: AttitudeEnv
    params: EnvParams

    def each(self, function: Callable, rows: slice, *samples: Any) -> Any:
        """What ``function(*sample, context)`` gives of the samples of some of the slews."""
        axes = parameters.fleet_axes(self.params)
        params = parameters.of_fleet(self.params, rows)

        def of_one(params, *sample):
            return function(*sample, self.env.context(params))

        return jax.vmap(of_one, (axes, *(0,) * len(samples)))(params, *samples)


def first_memory(controllers: Crew, of: Flown, slews: int) -> Memory | None:
    """Before the first decision, of so many slews a loop; None where nothing is remembered.

    Raises:
        ValueError: of flight loops side by side, one adapts and another does not.
    """
    loops = _loops(controllers)
    if not loops:
        return None
    if len({loop.adapts for loop in loops}) > 1:
        raise ValueError("of flight loops side by side all adapt, or none")
    rows = slice(0, slews * len(loops))
    return of.each(lambda _, context: loops[0].init(context), rows, jnp.arange(rows.stop))


def _loops(controllers):
    return [x for x in controllers if isinstance(x, FlightLoop)]


def decide(
    controllers: Crew, of: Flown, memory: Memory | None, told: chex.Array, states: Any
) -> tuple[chex.Array, Memory | None]:
    """The actions of all slews, and what is remembered after them.

    Args:
        controllers: flight loops first; each flies as many of the slews as the others.
        of: what is flown.
        memory: of the flight loops before it.
        told: (slews, 11) observations, as a controller without a loop is told.
        states: (slews,), of which a flight loop is told the measurements.
    """
    count, loops = len(told) // len(controllers), _loops(controllers)
    looped = slice(0, count * len(loops))
    if loops:
        measurements = jax.vmap(measured)(jax.tree.map(lambda x: x[looped], states))
        observed, memory = of.each(loops[0].observed, looped, memory, measurements)
        told = jnp.concatenate([observed, told[looped.stop :]])
    actions = []
    for n, controller in enumerate(controllers):
        rows = slice(n * count, (n + 1) * count)
        if isinstance(controller, FlightLoop):
            own = jax.tree.map(lambda x, rows=rows: x[rows], memory)
            actions.append(of.each(controller.act, rows, own, told[rows]))
        else:
            actions.append(of.each(controller, rows, told[rows]))
    action = jnp.concatenate(actions)
    if loops:
        memory = of.each(loops[0].after, looped, memory, action[looped])
    return action, memory


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
        env, params: that they fly, as of :class:`Flown`.
        moment: the slews' keys, from which each step's is folded in, and which step it is.
        before: memory, observations (slews, 11) and states.

    Returns:
        The memory, and what ``env.step_env`` returns of each slew.
    """
    (keys, index), (memory, observation, state) = moment, before
    action, memory = decide(controllers, Flown(env, params), memory, observation, state)
    keys = jax.vmap(jax.random.fold_in, (0, None))(keys, index)
    axes = parameters.fleet_axes(params)
    return memory, jax.vmap(env.step_env, (0, 0, 0, axes))(keys, state, action, params)
