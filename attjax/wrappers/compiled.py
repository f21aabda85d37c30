"""Compiled programs for libraries that step from Python: an environment's reset and step.

The environment is static, so that all who use the same one share a program a batch size.
Observations are float32; what ``info`` describes comes as one dictionary without nesting.
"""

import functools

import chex
import jax
import jax.numpy as jnp

from attjax import sharding
from attjax.envs import batch, restart
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.parameters import EnvParams, EnvState


@functools.partial(jax.jit, static_argnames="env")
def reset(env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey) -> tuple[chex.Array, EnvState]:
    """Start an episode. Returns the observation and the state."""
    observation, state = env.reset(key, params)
    return _single(observation), state


@functools.partial(jax.jit, static_argnames="env", donate_argnames="state")
def step(
    env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey, state: EnvState, action: chex.Numeric
) -> tuple[EnvState, tuple]:
    """One agent step without reset; the state is donated.

    Args:
        env, params, action: as for the environment.
        key: of all steps of the episode; each folds its time in.
        state: before the step.

    Returns:
        The state, and observation, reward, terminated, truncated and what describes the
        spacecraft after the step.
    """
    key = jax.random.fold_in(key, state.time)
    observation, state, reward, terminated, info = env.step_env(key, state, action, params)
    return state, (_single(observation), reward, terminated, info["truncated"], _described(info))


@functools.partial(jax.jit, static_argnames="env")
def reset_batch(
    env: AttitudeEnv, params: EnvParams, keys: chex.PRNGKey
) -> tuple[chex.Array, EnvState]:
    """Start an episode for each key. Returns the observations and the states."""
    observations, states = jax.vmap(env.reset, (0, None))(keys, params)
    return _single(observations), states


@jax.jit
def choose(mask: chex.Array, new: chex.ArrayTree, old: chex.ArrayTree) -> chex.ArrayTree:
    """The rows of one pytree where the mask (batch,) says so, else those of another."""
    return jax.tree.map(
        lambda a, b: jnp.where(mask.reshape(-1, *[1] * (a.ndim - 1)), a, b), new, old
    )


@functools.partial(
    jax.jit,
    static_argnames="env",
    donate_argnames="states",
    compiler_options=sharding.COMPILER_OPTIONS,
)
def step_batch(
    env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey, states: EnvState, actions: chex.Array
) -> tuple[chex.PRNGKey, EnvState, tuple]:
    """One agent step of all spacecraft, ended episodes restarted; the states are donated.

    Returns:
        The next key, the states, and final observations (before a restart), what describes
        the spacecraft there, observations, rewards, terminated, truncated.
    """
    key, step_key = jax.random.split(key)
    observations, states, rewards, terminated, truncated, info = batch.step(
        env, params, step_key, states, actions
    )
    final = _single(info["final_observation"]), _described(info)
    return key, states, (*final, _single(observations), rewards, terminated, truncated)


@functools.partial(
    jax.jit,
    static_argnames="env",
    donate_argnames="states",
    compiler_options=sharding.COMPILER_OPTIONS,
)
def step_batch_later_reset(
    env: AttitudeEnv,
    params: EnvParams,
    key: chex.PRNGKey,
    states: EnvState,
    actions: chex.Array,
    ended: chex.Array,
) -> tuple[chex.PRNGKey, EnvState, tuple]:
    """One agent step of the spacecraft that have not ended, and a new episode for the others.

    Args:
        env, params, key, states, actions: as for :func:`step_batch`; the states are donated.
        ended: (batch,) bool, whose episode ended in the step before.

    Returns:
        The next key, the states, and what describes the spacecraft after the step, observations,
        rewards, terminated, truncated; the last three are 0 where ``ended``.
    """
    key, step_key, reset_key = jax.random.split(key, 3)
    step_keys = jax.random.split(step_key, len(actions))
    observations, states, *results, info = jax.vmap(env.step_env, (0, 0, 0, None))(
        step_keys, states, actions, params
    )
    observations, states = restart.restart(
        lambda row: env.reset(jax.random.fold_in(reset_key, row), params),
        ended,
        (observations, states),
    )
    results = [jnp.where(ended, jnp.zeros_like(x), x) for x in (*results, info["truncated"])]
    return key, states, (_described(info), _single(observations), *results)


def _described(info):
    outcome = info["outcome"]
    return {"score": info["score"], "is_success": outcome["success_rate"], **outcome}


def _single(x):
    return jnp.asarray(x, jnp.float32)
