"""An environment in a flight loop is the flight loop outside the environment."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv, flight_loop
from attjax.control.classical import phase_plane
from attjax.control.looped import LoopedEnv
from attjax.envs.initial_state import starts_whole
from attjax.envs.parameters import measured
from attjax.evaluation.flown import angle_between
from attjax.world import Actuators, Sensors, StarTracker, World

SLOW = World(
    sensors=Sensors(
        star_tracker=StarTracker(cross_boresight_arcsec=20, rate_hz=240 / 34, latency=0.05)
    ),
    actuators=Actuators(delay=7, gain=0.95),
)
STEPS = 400


@functools.cache
def flown(world, start=0):
    """Observations, actions and errors of the estimate, by the loop inside and outside."""
    env = AttitudeEnv(5, world=world)
    params, key, inside = env.default_params, jax.random.key(3), LoopedEnv(env)
    context, loop = env.context(params), flight_loop(phase_plane)

    @jax.jit
    def by_the_loop():
        def step(carry, index):
            state, memory = carry
            observation, memory = loop.observed(memory, measured(state), context)
            action = loop.act(memory, observation, context)
            memory = loop.after(memory, action, context)
            _, state, *_ = env.step_env(jax.random.fold_in(key, index), state, action, params)
            return (state, memory), (observation, action)

        _, state = env.reset(key, params)
        return jax.lax.scan(step, (state, loop.init(context)), jnp.arange(STEPS))[1]

    @jax.jit
    def in_the_environment():
        def step(carry, index):
            observation, state = carry
            action = phase_plane(observation, context)
            estimate = jnp.stack(state.memory.estimate.quaternion)
            error = angle_between(estimate, state.quaternion)
            later, state, *_ = inside.step_env(
                jax.random.fold_in(key, index), state, action, params
            )
            return (later, state), (observation, action, error)

        observation, state = inside.reset(key, params)
        state = state.replace(time=state.time + start)
        return jax.lax.scan(step, (observation, state), jnp.arange(STEPS))[1]

    return by_the_loop(), in_the_environment()


@pytest.mark.parametrize("world", [SLOW, World.named("stress")], ids=["slow", "stress"])
def test_an_agent_is_shown_what_a_flight_loop_shows(world):
    (observations, actions), (shown, acted, _) = flown(world)
    np.testing.assert_array_equal(shown, observations)
    np.testing.assert_array_equal(acted, actions)
    assert len(np.unique(actions)) > 3


def test_the_estimate_is_not_the_measurement():
    _, (_, _, error) = flown(SLOW)
    assert 0 < np.sqrt(np.mean(error[40:] ** 2)) < 0.7 * np.deg2rad(20 / 3600) * np.sqrt(3)


def test_an_episode_may_begin_at_any_time():
    """Sensors sample by the episode's clock, and the loop knows when they do.

    A star tracker of 7 Hz does so every 34 RK4 steps, 3 decisions of 6 steps are 18.
    """
    _, (_, _, error) = flown(SLOW)
    _, (_, _, later) = flown(SLOW, start=301)
    assert np.sqrt(np.mean(later[40:] ** 2)) < 1.5 * np.sqrt(np.mean(error[40:] ** 2))


def test_all_else_is_the_environments():
    env = AttitudeEnv(5, world=SLOW)
    inside = LoopedEnv(env)
    assert inside == LoopedEnv(env) and hash(inside) == hash(LoopedEnv(env))
    assert inside.spacecraft == env.spacecraft and inside.num_actions == env.num_actions
    _, state = jax.eval_shape(inside.reset, jax.random.key(0), env.default_params)
    assert state.memory is not None
    assert bool(starts_whole(inside.reset(jax.random.key(0), env.default_params)[1]))
