"""attjax's contenders: flights through random actions, compiled ahead of the timing."""

import functools
import time

import jax
import jax.numpy as jnp
from common import Flight
from jax.sharding import NamedSharding, PartitionSpec

import attjax
from attjax import AttitudeEnv, sharding
from attjax.envs import batch

FRAMESKIP = 20
ENV = AttitudeEnv(FRAMESKIP)
AGENT_STEPS_A_CALL = 2**21
STEPS_A_CALL = (16, 1000)
"""Fewest and most agent steps a spacecraft in one call; a short flight pays for its start."""


def steps_a_call(num_envs: int) -> int:
    """Agent steps of each spacecraft in one call."""
    return min(max(AGENT_STEPS_A_CALL // num_envs, STEPS_A_CALL[0]), STEPS_A_CALL[1])


def fused(num_envs: int, num_devices: int = 1) -> Flight:
    """The whole agent step of a batch, ``attjax.envs.batch.open_loop``."""
    key, states, actions = _start(num_envs)
    mesh = sharding.mesh(num_devices)
    states = jax.device_put(states, NamedSharding(mesh, PartitionSpec(sharding.AXIS)))
    actions = jax.device_put(actions, NamedSharding(mesh, PartitionSpec(None, sharding.AXIS)))
    lower = functools.partial(batch.open_loop.lower, num_devices=num_devices)
    return _flight(lower, (ENV,), (ENV.default_params, key), states, actions)


def physics(num_envs: int) -> Flight:
    """``vmap(attjax.step)`` in a scan: no reward, no observation, no end of episode."""
    _, states, actions = _start(num_envs)
    options = sharding.COMPILER_OPTIONS if jax.default_backend() == "cpu" else None

    def fly(params, states, actions):
        def body(states, actions):
            step = functools.partial(attjax.step, frameskip=FRAMESKIP)
            return jax.vmap(step, (0, 0, None))(states, actions, params), None

        return jax.lax.scan(body, states, actions)[0], None

    fly = jax.jit(fly, donate_argnums=1, compiler_options=options)
    return _flight(fly.lower, (), (ENV.default_params,), states, actions)


def users_scan(num_envs: int) -> Flight:
    """``jit(vmap(env.step))`` in a scan, as one would write it for gymnax."""
    key, states, actions = _start(num_envs)

    def fly(params, key, states, actions):
        def body(carry, actions):
            key, states, _, total = carry
            key, step_key = jax.random.split(key)
            observations, states, rewards, _, _, _ = jax.jit(jax.vmap(ENV.step, (0, 0, 0, None)))(
                jax.random.split(step_key, num_envs), states, actions, params
            )
            return (key, states, observations, total + rewards), None

        observations = jnp.zeros((num_envs, *ENV.observation_space(params).shape))
        start = key, states, observations, jnp.zeros(num_envs)
        _, states, observations, total = jax.lax.scan(body, start, actions)[0]
        return states, (observations, total)

    fly = jax.jit(fly, donate_argnums=2)
    return _flight(fly.lower, (), (ENV.default_params, key), states, actions)


def _start(num_envs):
    key = jax.random.key(0)
    _, states = jax.vmap(ENV.reset, (0, None))(jax.random.split(key, num_envs), ENV.default_params)
    shape = (steps_a_call(num_envs), num_envs)
    return key, states, jax.random.randint(key, shape, 0, ENV.num_actions)


def _flight(lower, static, arguments, states, actions):
    """A flight that goes on from where the last call left the states, which are donated."""
    start = time.perf_counter()
    compiled = lower(*static, *arguments, states, actions).compile()
    compile_s = time.perf_counter() - start
    current = [states]

    def call():
        current[0], *others = compiled(*arguments, current[0], actions)
        jax.block_until_ready((current[0], others))

    return Flight(call, actions.size, compile_s)
