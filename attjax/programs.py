"""Compiled programs for libraries that step from Python: an environment's reset and step.

The environment is static, so that all who use the same one share a program a batch size.
Observations are float32; what ``info`` describes comes as one dictionary without nesting.
"""

import functools

import jax
import jax.numpy as jnp

from attjax import vector


@functools.partial(jax.jit, static_argnames="env")
def reset(env, params, key):
    """Start an episode. Returns the observation and the state."""
    observation, state = env.reset(key, params)
    return _single(observation), state


@functools.partial(jax.jit, static_argnames="env", donate_argnames="state")
def step(env, params, state, action):
    """One agent step without reset; the state is donated.

    Returns:
        The state, and observation, reward, terminated, truncated and what describes the
        spacecraft after the step.
    """
    key = jax.random.key(0)  # a step without reset draws nothing
    observation, state, reward, terminated, info = env.step_env(key, state, action, params)
    return state, (_single(observation), reward, terminated, info["truncated"], _described(info))


@functools.partial(jax.jit, static_argnames=("env", "num_envs"))
def reset_batch(env, params, key, num_envs):
    """Start all episodes. Returns a key for :func:`step_batch`, the observations, the states."""
    key, reset_key = jax.random.split(key)
    keys = jax.random.split(reset_key, num_envs)
    observations, states = jax.vmap(env.reset, (0, None))(keys, params)
    return key, _single(observations), states


@functools.partial(
    jax.jit,
    static_argnames="env",
    donate_argnames="states",
    compiler_options=vector.COMPILER_OPTIONS,
)
def step_batch(env, params, key, states, actions):
    """One agent step of all spacecraft, ended episodes restarted; the states are donated.

    Returns:
        The next key, the states, and final observations (before a restart), what describes
        the spacecraft there, observations, rewards, terminated, truncated.
    """
    key, step_key = jax.random.split(key)
    observations, states, rewards, terminated, truncated, info = vector.step(
        env, params, step_key, states, actions
    )
    final = _single(info["final_observation"]), _described(info)
    return key, states, (*final, _single(observations), rewards, terminated, truncated)


def _described(info):
    return {"score": info["score"], **info["outcome"]}


def _single(x):
    return jnp.asarray(x, jnp.float32)
