"""A controller over many slews: what comes of each, or every step of them."""

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
from attjax.envs.context import Context
from attjax.envs.keys import observation_key, steps_key
from attjax.envs.parameters import EnvParams, EnvState
from attjax.sharding import SHARED, SPLIT
from attjax.values import integer

Controller = Callable[[chex.Array, Context], chex.Array]
"""``act(observation (11,), context) -> action``; a pytree, e.g. ``jax.tree_util.Partial``."""


SLEWS_TOGETHER = 512
"""Most slews of a block on CPU, whose states and hidden layers of 64 fit the cache of a core."""

SLEWS_A_CALL = 2**14
"""About the most slews between two calls of a progress."""


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
    """

    closest_angle: chex.Array
    closest_rate: chex.Array
    terminal_angle: chex.Array
    terminal_rate: chex.Array
    overspeed: chex.Array
    last_outside: chex.Array
    score: chex.Array
    impulse: chex.Array


@struct.dataclass
class History:
    """Every agent step of some slews; fields are (steps, slews, ...), after each step.

    Attributes:
        quaternion: (..., 4) error quaternion.
        angular_velocity: (..., 3) rad/s.
        torque: (..., 3) torque of the action that led there, N m.
    """

    quaternion: chex.Array
    angular_velocity: chex.Array
    torque: chex.Array


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
    if (integer(episodes) or 0) < 1:
        raise ValueError(f"episodes is {episodes!r}; it must be an integer at least 1")
    keys = jax.random.split(key, episodes)
    calls = math.ceil(episodes / SLEWS_A_CALL)
    num_devices, blocks, size = _shape_of_call(math.ceil(episodes / calls))
    a_call, flown = num_devices * blocks * size, []
    for start in range(0, episodes, a_call):
        rows = np.arange(start, start + a_call) % episodes  # to fill the last
        part = keys[rows].reshape(num_devices * blocks, size)
        flown.append(jax.device_get(fly_blocks(controller, env, params, part, num_devices)))
        if progress is not None:
            progress(min(start + a_call, episodes))
    return jax.tree.map(lambda *x: np.concatenate(x).reshape(-1)[:episodes], *flown)


def _shape_of_call(slews):
    """Devices, blocks of each and slews of a block, of a call that flies at least so many."""
    devices = sharding.devices()
    if devices[0].platform != "cpu":
        return 1, 1, slews
    num_devices = min(len(devices), math.ceil(slews / SLEWS_TOGETHER))
    blocks = math.ceil(slews / (num_devices * SLEWS_TOGETHER))
    return num_devices, blocks, math.ceil(slews / (num_devices * blocks))


@functools.partial(
    jax.jit, static_argnames=("env", "num_devices"), compiler_options=sharding.COMPILER_OPTIONS
)
def fly_blocks(
    controller: Controller,
    env: AttitudeEnv,
    params: EnvParams,
    keys: chex.PRNGKey,
    num_devices: int = 1,
) -> Episodes:
    """Fly the slews of (blocks, slews) keys; the devices share the blocks. For :func:`fly`."""
    on_device = sharding.on_devices(
        num_devices,
        lambda controller, params, keys: jax.lax.map(
            lambda block: _fly_block(controller, env, params, block), keys
        ),
        (SHARED, SHARED, SPLIT),
        SPLIT,
    )
    return on_device(controller, params, keys)


def _fly_block(controller, env, params, reset_keys):
    observation, state = jax.vmap(env.reset, (0, None))(reset_keys, params)
    keys, context = jax.vmap(steps_key)(reset_keys), env.context(params)

    def step(index, carry):
        observation, state, so_far, excess = carry
        results = _step(controller, env, params, keys, index, observation, state)
        updated, excess = _updated(so_far, excess, index + 1, results, context, params)
        ended = so_far.overspeed
        so_far = jax.tree.map(lambda old, new: jnp.where(ended, old, new), so_far, updated)
        return *results[:2], so_far, excess

    zero = jnp.zeros(len(reset_keys), observation.dtype)
    start = Episodes(zero + jnp.inf, zero, zero, zero, zero > 0, zero.astype(jnp.int32), zero, zero)
    steps = params.max_steps_in_episode
    return jax.lax.fori_loop(0, steps, step, (observation, state, start, zero))[2]


def _step(controller, env, params, keys, index, observation, state):
    """What ``step_env`` returns of all slews under the controller, each with a key of its own."""
    action = jax.vmap(controller, (0, None))(observation, env.context(params))
    keys = jax.vmap(jax.random.fold_in, (0, None))(keys, index)
    return jax.vmap(env.step_env, (0, 0, 0, None))(keys, state, action, params)


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


@functools.partial(jax.jit, static_argnames=("env", "steps"))
def record(
    controller: Controller,
    env: AttitudeEnv,
    params: EnvParams,
    key: chex.PRNGKey,
    start: EnvState,
    steps: int,
) -> History:
    """Fly slews from a batch of states without ending them early, and keep every step.

    Of slews of :func:`random_slews`, and with the same key, they are the flights of :func:`fly`.
    """
    slews = len(start.time)
    first = jax.vmap(lambda key, state: env.observe(observation_key(key), state, params))
    observation = first(jax.random.split(key, slews), start)
    keys = jax.vmap(steps_key)(jax.random.split(key, slews))

    def step(carry, index):
        observation, state, _, _, info = _step(controller, env, params, keys, index, *carry)
        history = History(state.quaternion, state.angular_velocity, info["torque"])
        return (observation, state), history

    return jax.lax.scan(step, (observation, start), jnp.arange(steps))[1]
