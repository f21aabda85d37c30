"""What is drawn for an episode in an imperfect world, and what becomes of commands there."""

import dataclasses

import jax
import numpy as np
import pytest
from bodies import LM50
from imperfect import Oracle
from worlds import EFFECTS, flown, plants, start, world

from attjax import AttitudeEnv, Spacecraft
from attjax.envs import torques
from attjax.world import IDEAL, World


@pytest.mark.parametrize("delay", [1, 7, 30])
def test_a_late_pulse_comes_late_across_agent_steps_too(x64, delay):
    """Pulses of 1/240 s, each in its own RK4 step, against DOP853."""
    env = AttitudeEnv(5, world=world(actuators={"delay": delay}))
    state, actions = start(env), [1, 4, 0, 13, 6, 2, 17, 0, 0]
    after = flown(env, state, actions)
    table = np.asarray(env.default_params.torque_table)
    pulses = {6 * n + delay: table[action] for n, action in enumerate(actions)}
    oracle = Oracle(state.plant)
    _, rate = oracle.fly(state.quaternion, state.angular_velocity, pulses, 6 * len(actions))
    np.testing.assert_allclose(after.angular_velocity, rate, rtol=0, atol=1e-11)


@pytest.mark.parametrize("delay", [1, 7, 30])
def test_a_held_torque_comes_late_and_lasts_until_the_next(x64, delay):
    craft = Spacecraft(inertia=LM50.tolist(), torque_levels=(0.02,), torque_held=True)
    env = AttitudeEnv(5, spacecraft=craft, world=world(actuators={"delay": delay}))
    state, actions = start(env), [1, 4, 0, 3, 6, 2, 5, 1, 1]
    after = flown(env, state, actions)
    table = np.asarray(env.default_params.torque_table)
    steps = 6 * len(actions)
    held = {n: table[actions[(n - delay) // 6]] for n in range(delay, steps)}
    _, rate = Oracle(state.plant).fly(state.quaternion, state.angular_velocity, held, steps)
    np.testing.assert_allclose(after.angular_velocity, rate, rtol=0, atol=1e-11)


def test_jitter_delays_each_command_by_its_own():
    """Each pulse changes the rate in its own RK4 step, which the queue tells."""
    jitter = {"uniform": [0, 12]}
    env = AttitudeEnv(5, world=world(actuators={"delay": 2, "delay_jitter": jitter}))
    params, keys = env.default_params, jax.random.split(jax.random.key(2), 2000)

    def last_start(key):
        state = env.reset(key, params)[1]
        return env.step_env(key, state, 1, params)[1].plant.queue.starts[-1] + 6

    starts = np.asarray(jax.vmap(last_start)(keys))
    assert set(starts) == set(range(2, 15))
    counts = np.bincount(starts.astype(int))[3:14]  # the ends have half the chance
    assert abs(counts.mean() - 2000 / 12) < 4 * np.sqrt(2000 / 12 / 11) and counts.std() < 25


def test_commands_lose_what_actuators_lack():
    """One by one, by hand."""
    duration, params = 1 / 240, AttitudeEnv(5).default_params

    def torque(action, time=0.0, **table):
        env = AttitudeEnv(5, world=world(actuators=table))
        state = env.reset(jax.random.key(0), params)[1]
        return np.asarray(torques.acting_torque(state.replace(time=time * 40), action, params, 5))

    np.testing.assert_allclose(torque(2, gain=0.9), [-0.45, 0, 0], rtol=1e-6)
    assert not torque(13, dead_levels=[3]).any() and torque(7, dead_levels=[3]).any()
    late = {"dead_levels": [1], "fault_time": 10.0}
    assert torque(1, 9.9, **late).any() and not torque(1, 10.0, **late).any()
    weak = {"faulty_axes": [2], "fault_gain": 0.25}
    np.testing.assert_allclose(torque(3, **weak), [0, 0.125, 0], rtol=1e-6)
    np.testing.assert_allclose(torque(5, **weak), [0, 0, 0.5], rtol=1e-6)
    assert not torque(13, minimum_impulse=0.006 * duration).any()
    assert torque(7, minimum_impulse=0.006 * duration).any()
    # A hundredth of the time is rounded to a twentieth's multiple: 0; a tenth stays.
    np.testing.assert_allclose(
        torque(7, on_time_granularity=duration / 20), [0.05, 0, 0], rtol=1e-5
    )
    assert not torque(13, on_time_granularity=duration / 20).any()
    np.testing.assert_allclose(
        torque(7, on_time_granularity=duration / 7), [0.5 / 7, 0, 0], rtol=1e-5
    )
    tilted = torque(1, misalignment_deg=10)
    np.testing.assert_allclose(np.linalg.norm(tilted), 0.5, rtol=1e-6)
    np.testing.assert_allclose(tilted[0], 0.5 * np.cos(np.deg2rad(10)), rtol=1e-6)


def test_what_the_controller_believes_is_not_what_flies():
    """The context has LM50's inertia; the plant twice that, and turned axes."""
    env = AttitudeEnv(5, world=world(uncertainty={"inertia_factor": 2, "axes_turned_deg": 90}))
    state = env.reset(jax.random.key(0), env.default_params)[1]
    np.testing.assert_array_equal(env.context(env.default_params).inertia, np.float32(LM50))
    moments, axes = np.linalg.eigh(state.plant.inertia)
    np.testing.assert_allclose(moments, 2 * np.sort(LM50), rtol=1e-5)
    angle = np.arccos(np.abs(np.diag(axes[:, [1, 0, 2]])).max())  # of some axis, at least
    assert angle < np.pi / 2
    kick = np.asarray(
        env.step_env(jax.random.key(0), state, 1, env.default_params)[1].angular_velocity
    )
    expected = np.linalg.solve(np.asarray(state.plant.inertia), [0.5 / 240, 0, 0])
    np.testing.assert_allclose(kick, expected, rtol=2e-3)


def test_draws_are_as_described():
    """Ranges, means and independence of what is drawn, over 4,000 episodes."""
    ball = (0.5, 0.5, 0.5)  # no draw of which is impossible
    env = AttitudeEnv(
        5,
        spacecraft=Spacecraft(inertia=ball),
        world=world(
            uncertainty={"moment_factor": {"uniform": [0.8, 1.2]}},
            actuators={
                "gain": {"normal": [1, 0.1], "truncated": [0.7, 1.3]},
                "misalignment_deg": 5,
            },
            disturbances={"constant_torque": {"log_uniform": [1e-6, 1e-2]}},
        ),
    )
    drawn = plants(env)
    factors = np.asarray(drawn.inertia) / ball
    assert factors.min() > 0.79 and factors.max() < 1.21
    np.testing.assert_allclose(factors.mean(axis=0), [1, 1, 1], atol=0.01)
    assert abs(np.corrcoef(factors.T)[1, 2]) < 0.05
    gains = np.linalg.norm(drawn.actuators.directions, axis=-1)
    assert gains.min() >= 0.7 and gains.max() <= 1.3
    np.testing.assert_allclose([gains.mean(), gains.std()], [1, 0.0986], atol=0.004)
    torque = np.stack(drawn.disturbances.constant, axis=-1)
    size = np.log10(np.linalg.norm(torque, axis=-1))
    np.testing.assert_allclose(np.quantile(size, [0.25, 0.5, 0.75]), [-5, -4, -3], atol=0.12)
    unit = torque / np.linalg.norm(torque, axis=-1, keepdims=True)
    np.testing.assert_allclose(unit.mean(axis=0), 0, atol=0.04)
    np.testing.assert_allclose(unit.T @ unit / len(unit), np.eye(3) / 3, atol=0.03)


def test_what_is_drawn_does_not_hang_on_what_else_is():
    """So that conditions are compared on the same spacecraft."""
    few = {"uncertainty": {"moment_factor": {"uniform": [0.8, 1.2]}}}
    more = few | {"actuators": {"gain": {"uniform": [0.9, 1.1]}}, "disturbances": EFFECTS["all"]}
    ones, others = (plants(AttitudeEnv(5, world=world(**x)), 8) for x in (few, more))
    np.testing.assert_array_equal(ones.inertia, others.inertia)


def test_no_drawn_inertia_is_impossible():
    """A moment that exceeds the other two together is cut: 4,000 wide draws."""
    env = AttitudeEnv(5, world=world(uncertainty={"moment_factor": {"log_uniform": [0.1, 10]}}))
    moments = np.sort(np.asarray(plants(env).inertia), axis=-1)
    assert np.all(moments[:, 2] <= (moments[:, 0] + moments[:, 1]) * (1 + 1e-6))


def test_the_ideal_world_is_no_world_at_all():
    """The same program, and the same state, as without one."""
    env, plain = AttitudeEnv(5, world=World(name="nothing in it")), AttitudeEnv(5)
    state = env.reset(jax.random.key(0), env.default_params)[1]
    assert state.plant is None
    text = [
        jax.jit(x.step).lower(jax.random.key(0), state, 1, x.default_params).as_text()
        for x in (env, plain)
    ]
    assert text[0] == text[1]
    assert IDEAL.is_ideal and dataclasses.replace(IDEAL, orbit=None).is_ideal
