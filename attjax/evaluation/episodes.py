"""A controller over many slews: what comes of each."""

import dataclasses
import functools
import math
from collections.abc import Callable

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax import sharding
from attjax.dynamics import numerics
from attjax.dynamics import quaternion as quaternions
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.keys import steps_key
from attjax.envs.parameters import EnvParams, EnvState
from attjax.evaluation import flown as flying
from attjax.evaluation.flown import Controller, Crew
from attjax.sharding import SHARED, SPLIT
from attjax.values import integer

SLEWS_TOGETHER = 512
"""Most slews of a block on CPU, whose states and hidden layers of 64 fit the cache of a core."""

SLEWS_A_CALL = 2**14
"""About the most slews between two calls of a progress."""


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


def random_slews(
    env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey, episodes: int
) -> tuple[chex.Array, EnvState]:
    """Observations (episodes, 11) and states at the start of ``episodes`` random slews."""
    return jax.vmap(env.reset, (0, None))(jax.random.split(key, episodes), params)


def fly(
    controller: Controller,
    env: AttitudeEnv,
    params: EnvParams,
    key: chex.PRNGKey,
    episodes: int,
    progress: Callable[[int], None] | None = None,
) -> Episodes:
    """Fly ``episodes`` random slews of ``params.max_steps_in_episode`` steps each.

    The devices share them, and what is kept of each is 37 bytes, however many there are.

    Args:
        controller: flies them; on CPU a block of them at a time, so that what a network makes of
            it stays in a core's cache.
        env, params: what flies.
        key: of the slews of :func:`random_slews`.
        episodes: how many.
        progress: called now and then with how many have flown.

    Raises:
        ValueError: there are none.
    """
    return _fly((controller,), env, params, key, (episodes, False, progress))


def fly_side_by_side(
    controllers: Crew, env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey, episodes: int
) -> list[Episodes]:
    """What comes of the same slews under each of several controllers, with how they hold.

    They are compiled together, which takes less time than one by one.

    Args:
        controllers: flight loops first.
        env, params, key, episodes: as of :func:`fly`.

    Raises:
        ValueError: there are no episodes.
    """
    flown = _fly(controllers, env, params, key, (episodes, True, None))
    return [
        jax.tree.map(lambda x, n=n: x[n :: len(controllers)], flown)
        for n in range(len(controllers))
    ]


def _fly(controllers, env, params, key, how):
    """The slews of each controller, one slew after the other."""
    episodes, judges_holding, progress = how
    if (integer(episodes) or 0) < 1:
        raise ValueError(f"episodes is {episodes!r}; it must be an integer at least 1")
    keys = jax.random.split(key, episodes)
    calls = math.ceil(episodes / SLEWS_A_CALL)
    num_devices, blocks, size = _shape_of_call(math.ceil(episodes / calls), len(controllers))
    a_call, flown = num_devices * blocks * size, []
    for start in range(0, episodes, a_call):
        rows = np.arange(start, start + a_call) % episodes  # to fill the last
        part = keys[rows].reshape(num_devices * blocks, size)
        block = fly_blocks(controllers, env, params, part, num_devices, judges_holding)
        flown.append(jax.device_get(block))
        if progress is not None:
            progress(min(start + a_call, episodes))
    slews = episodes * len(controllers)
    return jax.tree.map(lambda *x: np.concatenate(x).reshape(-1)[:slews], *flown)


def _shape_of_call(slews, controllers):
    """Devices, blocks of each and slews of a block, of a call that flies at least so many."""
    devices, together = sharding.devices(), max(1, SLEWS_TOGETHER // controllers)
    if devices[0].platform != "cpu":
        return 1, 1, slews
    num_devices = min(len(devices), math.ceil(slews / together))
    blocks = math.ceil(slews / (num_devices * together))
    return num_devices, blocks, math.ceil(slews / (num_devices * blocks))


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
    """Fly the slews of (blocks, slews) keys; the devices share the blocks. For :func:`fly`."""
    fly_block = functools.partial(_fly_block, env, judges_holding)
    on_device = sharding.on_devices(
        num_devices,
        lambda controllers, params, keys: jax.lax.map(
            lambda block: fly_block(controllers, params, block), keys
        ),
        (SHARED, SHARED, SPLIT),
        SPLIT,
    )
    return on_device(controllers, params, keys)


def _fly_block(env, judges_holding, controllers, params, keys):
    """Each controller's slews; the results have a row for each slew, and in it one for each."""
    slews, count = len(keys), len(controllers)
    reset_keys = jnp.concatenate([keys] * count)
    observation, state = jax.vmap(env.reset, (0, None))(reset_keys, params)
    keys, context = jax.vmap(steps_key)(reset_keys), env.context(params)
    memory = flying.first_memory(controllers, context, slews)

    def step(index, carry):
        *before, so_far, excess = carry
        memory, results = flying.step(controllers, env, params, (keys, index), before)
        updated, excess = _updated(so_far, excess, index + 1, results, context, params)
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


def _updated(so_far, excess, number, results, context, params):
    """The outcome after a step, counted from 1, were none ended; and what the impulse lacks."""
    _, state, _, terminated, info = results
    angle = jax.vmap(quaternions.error_angle)(state.quaternion)
    rate = jnp.sqrt(jax.vmap(numerics.squared_norm)(state.angular_velocity))
    torque = jnp.sqrt(jax.vmap(numerics.squared_norm)(info["torque"]))
    closer = angle < so_far.closest_angle
    impulse, excess = numerics.add((so_far.impulse, excess), torque * context.torque_duration)
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
