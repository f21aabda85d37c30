"""Many spacecraft side by side, with new episodes drawn only for those whose episode ended."""

import functools
from typing import Any, TypeAlias

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jax.sharding import PartitionSpec

from attjax import sharding
from attjax.dynamics import numerics
from attjax.envs.restart import restart
from attjax.sharding import AXIS, SHARED, SPLIT

CPU_BLOCK = 4096
"""Spacecraft whose states and intermediate results fit a core's cache."""

Stepped: TypeAlias = tuple[chex.Array, chex.ArrayTree, chex.Array, chex.Array, chex.Array, dict]
"""Observations, states, rewards, terminated, truncated and info of a batch."""


def param_axes(env: Any, params: chex.ArrayTree) -> Any:
    """For ``vmap``: 0 for parameters in which the spacecraft differ, None for the others.

    They differ in those that have more axes than the environment's own, where it has None, any.
    """
    return jax.tree.map(
        lambda x, default: 0 if np.ndim(x) > np.ndim(default) else None, params, env.default_params
    )


def params_of(env: Any, params: chex.ArrayTree, row: chex.Numeric) -> chex.ArrayTree:
    """The parameters of one spacecraft of a batch."""
    axes = param_axes(env, params)
    return jax.tree.map(lambda x, axis: x if axis is None else x[row], params, axes)


def step(
    env: Any,
    params: chex.ArrayTree,
    key: chex.PRNGKey,
    states: chex.ArrayTree,
    actions: chex.Array,
) -> Stepped:
    """One agent step of a batch; as ``vmap(env.step)``, at half its cost: one key for all.

    The keys of single spacecraft are made where they are used, of those whose episode ended.

    Args:
        env: an environment of :class:`attjax.AttitudeEnv`'s protocol.
        params: its parameters; those in which the spacecraft differ have a leading axis (batch,).
        key: of this step.
        states: batched states, (batch, ...).
        actions: (batch,) integers, or (batch, 3) real, as the environment takes them.

    Returns:
        What ``env.step`` returns, each with a leading axis (batch,).
    """
    return step_and_restart(env, params, jax.random.split(key), states, actions)


def step_and_restart(
    env: Any,
    params: chex.ArrayTree,
    keys: chex.PRNGKey,
    states: chex.ArrayTree,
    actions: chex.Array,
) -> Stepped:
    """As :func:`step`, with two keys: of the steps, and of the new episodes."""
    step_key, fresh_key = keys
    step_keys = jax.random.split(step_key, len(actions))
    observations, states, rewards, terminated, info = jax.vmap(
        env.step_env, (0, 0, 0, param_axes(env, params))
    )(step_keys, states, actions, params)
    info = {**info, "final_observation": observations}
    truncated = info["truncated"]
    observations, states = restart(
        lambda row: env.reset(jax.random.fold_in(fresh_key, row), params_of(env, params, row)),
        terminated | truncated,
        (observations, states),
    )
    return observations, states, rewards, terminated, truncated, info


@struct.dataclass
class Totals:
    """Sums over an open-loop flight; fields are (batch,).

    Attributes:
        reward: of all steps.
        episodes: how many ended.
    """

    reward: chex.Array
    episodes: chex.Array


@functools.partial(
    jax.jit,
    static_argnames=("env", "num_devices"),
    donate_argnames="states",
    compiler_options=sharding.COMPILER_OPTIONS,
)
def open_loop(
    env: Any,
    params: chex.ArrayTree,
    key: chex.PRNGKey,
    states: chex.ArrayTree,
    actions: chex.Array,
    num_devices: int = 1,
) -> tuple[chex.ArrayTree, chex.Array, Totals]:
    """Fly a batch through given actions, with automatic reset: the fused rollout.

    Args:
        env, params: as in :func:`step`.
        key: of all new episodes.
        states: batched states, (batch, ...); donated.
        actions: (steps, batch) integers, or (steps, batch, 3) real, as the environment takes them.
        num_devices: devices, or CPU cores as devices, that share the batch; it must be a
            multiple of them. JAX makes one device of all cores, unless the configuration
            ``jax_num_cpu_devices`` says otherwise before its first use.

    Returns:
        The states, the observations (batch, size) after the last step, and the totals.

    Raises:
        ValueError: the actions are no such arrays, the states are of another batch, or the
            devices are too many or do not share it evenly.
    """
    _check_batch(states, actions, num_devices)
    fly = sharding.on_devices(
        num_devices,
        functools.partial(_fly_in_blocks, env),
        (SHARED, SHARED, SPLIT, PartitionSpec(None, AXIS)),
        SPLIT,
    )
    return fly(params, jax.random.split(key, num_devices), states, actions)


def _check_batch(states, actions, num_devices):
    are_integers = actions.ndim == 2 and jnp.issubdtype(actions.dtype, jnp.integer)
    are_real = actions.shape[2:] == (3,) and jnp.issubdtype(actions.dtype, jnp.floating)
    if not are_integers and not are_real:
        raise ValueError(
            f"actions has shape {actions.shape} and type {actions.dtype}; "
            f"it must be (steps, batch) integers or (steps, batch, 3) real"
        )
    batch = actions.shape[1]
    sizes = {x.shape[:1] for x in jax.tree.leaves(states)}
    if sizes != {(batch,)}:
        raise ValueError(f"states has leading axes {sorted(sizes)}; they must be ({batch},)")
    if not 1 <= num_devices <= len(sharding.devices()) or batch % num_devices:
        raise ValueError(
            f"num_devices is {num_devices}; it must be a divisor of the batch, {batch}, and at "
            f"most {len(sharding.devices())}, the devices of JAX"
        )


def _fly_in_blocks(env, params, keys, states, actions):
    """A device's part of the batch; on CPU block after block, each small enough for the cache."""
    steps, batch, *axes = actions.shape
    on_cpu = sharding.devices()[0].platform == "cpu"
    blocks = batch // CPU_BLOCK if on_cpu and batch % CPU_BLOCK == 0 else 1
    keys = jax.random.split(keys[jax.lax.axis_index(AXIS)], blocks)
    states = jax.tree.map(lambda x: x.reshape(blocks, -1, *x.shape[1:]), states)
    actions = actions.reshape(steps, blocks, -1, *axes).swapaxes(0, 1)
    flown = jax.lax.map(lambda block: _fly(env, params, *block), (keys, states, actions))
    return jax.tree.map(lambda x: x.reshape(batch, *x.shape[2:]), flown)


def _fly(env, params, key, states, actions):
    batch = actions.shape[1]
    observations = jnp.zeros((batch, *env.observation_space(params).shape))
    totals = Totals(jnp.zeros(batch), jnp.zeros(batch, int))

    def body(carry, inputs):
        states, _, totals, excess = carry
        keys, actions = inputs
        observations, states, reward, terminated, truncated, _ = step_and_restart(
            env, params, keys, states, actions
        )
        episodes = totals.episodes + (terminated | truncated)
        reward, excess = numerics.add((totals.reward, excess), reward)
        return (states, observations, Totals(reward, episodes), excess), None

    inputs = (jax.random.split(key, (len(actions), 2)), actions)
    return jax.lax.scan(body, (states, observations, totals, jnp.zeros(batch)), inputs)[0][:3]
