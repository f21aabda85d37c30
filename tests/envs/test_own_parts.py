"""Actuators and sensors of a user's own: where they act, and what they are given."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from worlds import flown, start, world

from attjax import AttitudeEnv, World
from attjax.envs import observation
from attjax.envs.parameters import measured
from attjax.world import Actuators


class Late(NamedTuple):
    """Half the torque, from 0.1 s on."""

    share: jax.Array

    def torque(self, torque, time):
        return jnp.where(time > 0.1, self.share * torque, torque)


@dataclasses.dataclass(frozen=True)
class Weakening:
    def drawn(self, draws):
        return Late(draws.number("weakening", 0.5))


class Noisy(NamedTuple):
    """A rate with noise, and an attitude that is not told at odd decisions."""

    size: jax.Array

    def told(self, measurement, state, key):
        noise = self.size * jax.random.normal(key, (3,))
        return measurement.replace(
            angular_velocity=state.angular_velocity + noise,
            has_quaternion=state.time % 2 == 0,
        )


@dataclasses.dataclass(frozen=True)
class Rough:
    def drawn(self, draws):
        return Noisy(draws.number("rough", 1e-3))


@pytest.mark.parametrize("others", [None, Actuators(gain=0.8)])
def test_an_actuator_of_ones_own_is_given_what_the_worlds_would_give(others):
    env = AttitudeEnv(20, world=World(actuators=others, own_actuators=(Weakening(),)))
    state = start(env)
    share = 0.5 * (1 if others is None else 0.8)
    for share_now in (2 * share, 2 * share, share, share):  # every 0.0875 s
        _, state, _, _, info = env.step_env(jax.random.key(0), state, 1, env.default_params)
        np.testing.assert_allclose(info["torque"], [0.5 * share_now, 0, 0], rtol=1e-6)
    weak = world(actuators={"faulty_axes": [1], "fault_gain": 0.5, "fault_time": 0.1})
    if others is None:
        alike = flown(AttitudeEnv(20, world=weak), start(AttitudeEnv(20, world=weak)), [1] * 4)
        np.testing.assert_allclose(state.angular_velocity, alike.angular_velocity, rtol=1e-5)


def test_a_sensor_of_ones_own_tells_the_same_to_loop_and_controller():
    env = AttitudeEnv(5, world=World(own_sensors=(Rough(),)))
    keys = jax.random.split(jax.random.key(1), 2000)
    states = jax.vmap(env.reset, (0, None))(keys, env.default_params)[1]
    told = jax.vmap(measured)(states)
    seen = jax.vmap(env.observe, (0, 0, None))(keys, states, env.default_params)
    np.testing.assert_array_equal(seen[:, observation.ANGULAR_VELOCITY], told.angular_velocity)
    errors = np.asarray(told.angular_velocity - states.angular_velocity)
    assert errors.std() == pytest.approx(1e-3, rel=0.05) and abs(errors.mean()) < 1e-4
    later = jax.vmap(measured)(states.replace(time=states.time + 1))
    assert not later.has_quaternion.any() and told.has_quaternion.all()
    again = np.asarray(later.angular_velocity - states.angular_velocity)
    assert abs(np.corrcoef(errors.ravel(), again.ravel())[0, 1]) < 0.05
