"""Which delay torques come with: found of all that can be, and then as good as known."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from worlds import world

from attjax import LM50, AttitudeEnv, flight_loop
from attjax.control import lateness
from attjax.control.classical import phase_plane
from attjax.envs.parameters import measured

UNKNOWN = {"actuators": {"delay": {"uniform": [0, 12]}}}
NOISY = {
    "sensors": {
        "star_tracker": {"cross_boresight_arcsec": 5.0, "roll_arcsec": 5.0},
        "gyro": {"angle_random_walk_deg_per_root_h": 0.054},
    }
}
HELD = dataclasses.replace(LM50, torque_held=True, torque_levels=(0.02, 0.002, 0.0002))


def flown(env, steps, delays=None):
    """Delays that were believed, and error angles, rad, of the same slew with each of the delays.

    (delays, steps) both. Of a delay that is known, where none are given.
    """
    params, loop = env.default_params, flight_loop(phase_plane, adapts=True)
    context = env.context(params)
    start = env.reset(jax.random.key(0), params)[1]

    def step(carry, key):
        state, memory = carry
        action, memory = loop.step(memory, measured(state), context)
        state = env.step_env(key, state, action, params)[1]
        angle = 2 * jnp.arctan2(jnp.linalg.norm(state.quaternion[:3]), abs(state.quaternion[3]))
        return (state, memory), (memory.delay(context), angle)

    def fly(delay):
        state = start
        if delays is not None:
            actuators = start.plant.actuators.replace(delay=delay)
            state = start.replace(plant=start.plant.replace(actuators=actuators))
        keys = jax.random.split(jax.random.key(0), steps)
        return jax.lax.scan(step, (state, loop.init(context)), keys)[1]

    given = [0] if delays is None else delays
    return jax.jit(jax.vmap(fly))(jnp.asarray(given, params.inertia.dtype))


@pytest.mark.parametrize("craft", [LM50, HELD], ids=["pulses", "held"])
def test_where_the_truth_is_told_it_is_known_after_the_first_torques(craft):
    env, delays = AttitudeEnv(5, spacecraft=craft, world=world(**UNKNOWN)), (0, 1, 5, 6, 8, 12)
    believed, _ = flown(env, 12, delays)
    assert np.all(believed[:, 0] == 6)  # the mean, before anything came of anything
    np.testing.assert_array_equal(believed[:, 4:].T, np.tile(delays, (8, 1)))


def test_in_noise_it_is_known_as_torques_are_seen():
    delays = 0, 3, 9, 12
    believed, _ = flown(AttitudeEnv(5, world=world(**UNKNOWN, **NOISY)), 200, delays)
    np.testing.assert_array_equal(believed[:, -50:].T, np.tile(delays, (50, 1)))


def test_what_it_holds_is_what_is_held_when_the_delay_is_known():
    _, found = flown(AttitudeEnv(5, world=world(**UNKNOWN)), 700, (3, 12))
    for delay, angles in zip((3, 12), found):
        known = AttitudeEnv(5, world=world(actuators={"delay": delay}))
        told = flown(known, 700)[1][0]
        assert np.mean(angles[-150:]) < 1.2 * np.mean(told[-150:]) < 2e-5


def test_the_delays_that_can_be():
    few = AttitudeEnv(5, world=world(actuators={"delay": {"uniform": [2, 5]}}))
    many = AttitudeEnv(5, world=world(actuators={"delay": {"uniform": [0, 240]}}))
    one = AttitudeEnv(5, world=world(actuators={"delay": 4}))
    jitter = {"delay": {"uniform": [2, 5]}, "delay_jitter": 2}
    other_each_time = AttitudeEnv(5, world=world(actuators=jitter))
    of = {x: x.context(x.default_params).knowledge for x in (few, many, one, other_each_time)}
    np.testing.assert_array_equal(lateness.delays_of(of[few]), [2, 3, 4, 5])
    np.testing.assert_array_equal(lateness.delays_of(of[many]), np.arange(0, 241, 10))
    assert of[one].delays is None and of[other_each_time].delays is None
    assert of[one].delay == 4 and of[other_each_time].delay == 6


def test_without_adaptation_it_is_the_mean():
    env = AttitudeEnv(5, world=world(**UNKNOWN))
    memory = flight_loop(phase_plane).init(env.context(env.default_params))
    assert memory.surprises is None and memory.delay(env.context(env.default_params)) is None
