"""The compiled program of an evaluation: blocks of slews, and what comes of each."""

import dataclasses
import functools

import chex
import jax
import jax.numpy as jnp
from flax import struct

from attjax import sharding
from attjax.dynamics import numerics
from attjax.dynamics import quaternion as quaternions
from attjax.envs import parameters
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.keys import steps_key
from attjax.envs.parameters import EnvParams
from attjax.evaluation import flown as flying
from attjax.evaluation.flown import Crew
from attjax.sharding import SHARED, SPLIT

HOLDING_SHARE = 5
"""The last fifth of an episode shows how well a controller holds its target."""


@struct.dataclass
class Holding:
    """The last fifth of each episode; fields are (episodes,).

    Attributes:
        squared: mean of φ², rad².
        most: largest φ, rad.
        estimate_squared: mean of the squared angle between what was believed and the truth, rad².
    """

    squared: chex.Array
    most: chex.Array
    estimate_squared: chex.Array


@struct.dataclass
class Episodes:
    """Outcome of each episode; fields are (episodes,). The start is not sampled.

    Attributes:
        closest_angle, closest_rate: φ, rad, and ‖ω‖, rad/s, when φ was smallest.
        terminal_angle, terminal_rate: the same at the last step.
        overspeed: whether the rate limit was exceeded, which ends the episode.
        last_outside: last step, counted from 1, with φ above the goal angle; 0 if none.
        score: return of Eq. 12–13.
        impulse: sum of the torque magnitudes times their duration, N m s.
        holding: None unless it was asked for.
    """

    closest_angle: chex.Array
    closest_rate: chex.Array
    terminal_angle: chex.Array
    terminal_rate: chex.Array
    overspeed: chex.Array
    last_outside: chex.Array
    score: chex.Array
    impulse: chex.Array
    holding: Holding | None = None


@functools.partial(
    jax.jit,
    static_argnames=("env", "num_devices", "judges_holding"),
    compiler_options=sharding.COMPILER_OPTIONS,
)
def fly_blocks(
    controllers: Crew,
    env: AttitudeEnv,
    params: EnvParams,
    keys: chex.PRNGKey,
    num_devices: int = 1,
    judges_holding: bool = False,
) -> Episodes:
    """Fly the slews of (blocks, slews) keys; the devices share the blocks. For :func:`fly`.

    Parameters in which the spacecraft differ have these two leading axes.
    """
    axes = parameters.fleet_axes(params)

    def fly(controllers, params, keys):
        differing = jax.tree.map(lambda x, axis: None if axis is None else x, params, axes)

        def fly_block(block):
            keys, own = block
            theirs = jax.tree.map(lambda x, own: x if own is None else own, params, own)
            return _fly_block(env, judges_holding, controllers, theirs, keys)

        return jax.lax.map(fly_block, (keys, differing))

    specs = jax.tree.map(lambda _, axis: SHARED if axis is None else SPLIT, params, axes)
    on_device = sharding.on_devices(num_devices, fly, (SHARED, specs, SPLIT), SPLIT)
    return on_device(controllers, params, keys)


def _fly_block(env, judges_holding, controllers, params, keys):
    """Each controller's slews; the results have a row for each slew, and in it one for each."""
    slews, count = len(keys), len(controllers)
    reset_keys = jnp.concatenate([keys] * count)
    axes = parameters.fleet_axes(params)
    params = jax.tree.map(
        lambda x, axis: x if axis is None else jnp.concatenate([x] * count), params, axes
    )
    observation, state = jax.vmap(env.reset, (0, axes))(reset_keys, params)
    keys, first = jax.vmap(steps_key)(reset_keys), parameters.of_fleet(params, 0)
    duration = env.context(first).torque_duration
    memory = flying.first_memory(controllers, flying.Flown(env, params), slews)

    def step(index, carry):
        *before, so_far, excess = carry
        memory, results = flying.step(controllers, env, params, (keys, index), before)
        updated, excess = _updated(so_far, excess, index + 1, results, duration, params)
        if judges_holding:
            error = flying.estimation_error(memory, before[2])
            holding = _held(so_far.holding, updated.terminal_angle, error, index, params)
            updated = dataclasses.replace(updated, holding=holding)
        ended = so_far.overspeed
        so_far = jax.tree.map(lambda old, new: jnp.where(ended, old, new), so_far, updated)
        return memory, *results[:2], so_far, excess

    zero = jnp.zeros(slews * count, observation.dtype)
    start = Episodes(zero + jnp.inf, zero, zero, zero, zero > 0, zero.astype(jnp.int32), zero, zero)
    if judges_holding:
        start = dataclasses.replace(start, holding=Holding(zero, zero, zero))
    steps = params.max_steps_in_episode
    flown = jax.lax.fori_loop(0, steps, step, (memory, observation, state, start, zero))[3]
    return jax.tree.map(lambda x: x.reshape(count, slews).T, flown)


def _held(holding, angle, error, index, params):
    """What is known of the last fifth after a step, were no episode ended."""
    steps = params.max_steps_in_episode
    first = steps - jnp.maximum(steps // HOLDING_SHARE, 1)
    share = jnp.where(index >= first, 1 / (steps - first), 0).astype(angle.dtype)
    return Holding(
        squared=holding.squared + share * angle**2,
        most=jnp.where(index >= first, jnp.maximum(holding.most, angle), holding.most),
        estimate_squared=holding.estimate_squared + share * error**2,
    )


def _updated(so_far, excess, number, results, duration, params):
    """The outcome after a step, counted from 1, were none ended; and what the impulse lacks."""
    _, state, _, terminated, info = results
    angle = jax.vmap(quaternions.error_angle)(state.quaternion)
    rate = jnp.sqrt(jax.vmap(numerics.squared_norm)(state.angular_velocity))
    torque = jnp.sqrt(jax.vmap(numerics.squared_norm)(info["torque"]))
    closer = angle < so_far.closest_angle
    impulse, excess = numerics.add((so_far.impulse, excess), torque * duration)
    updated = Episodes(
        closest_angle=jnp.where(closer, angle, so_far.closest_angle),
        closest_rate=jnp.where(closer, rate, so_far.closest_rate),
        terminal_angle=angle,
        terminal_rate=rate,
        overspeed=terminated,
        last_outside=jnp.where(angle > params.goal_angle, number, so_far.last_outside),
        score=so_far.score + info["score"],
        impulse=impulse,
    )
    return updated, excess
