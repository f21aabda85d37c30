"""Bounds of what can be observed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attjax import (
    AttitudeEnv,
    EnvState,
    Spacecraft,
)

pytestmark = pytest.mark.usefixtures("strict_promotion")

ENV = AttitudeEnv(frameskip=5)


def test_observation_space_samples_lie_inside():
    space = ENV.observation_space(ENV.default_params)
    samples = jax.vmap(space.sample)(jax.random.split(jax.random.key(0), 100))
    assert jnp.all(jax.vmap(space.contains)(samples))
    assert not space.contains(2 * space.high)
    assert not space.contains(space.high[:3])


def test_observation_space_holds_what_coasting_adds():
    """A spin at the limit about the intermediate axis, kicked, over one step of up to 30 s.

    With moments of 1 to 3 it tips over and gains 2/√3, along (1, 0, −1/√3) of the principal axes;
    the body's x axis is laid there, as no rate about a principal axis exceeds that at the start.
    """
    tilt = Rotation.from_rotvec([0, np.deg2rad(30), 0]).as_matrix()
    spacecraft = Spacecraft(inertia=tilt.T @ np.diag([1, 2, 3]) @ tilt, torque_levels=(0.5,))
    env = AttitudeEnv(7199, spacecraft=spacecraft)
    params, limit = env.default_params, spacecraft.rate_limit
    step = jax.jit(env.step_env)
    space, highest = env.observation_space(params), 0.0
    for steps in range(3000, 7200, 60):
        w = jnp.array([0, limit * (1 - 1e-6), 0], float)
        state = EnvState(jnp.array([0.0, 0, 0, 1]), w, jnp.array(0, jnp.int32))
        observed, *_ = step(None, state, 1, params.replace(frameskip=jnp.array(steps)))
        assert space.contains(observed)
        highest = max(highest, float(observed[8]))
    assert highest == pytest.approx(limit * 2 / 3**0.5, rel=0.02)
    np.testing.assert_allclose(space.high[:4], 1)
    np.testing.assert_allclose(space.high[4:8], space.high[8] / 2)
    np.testing.assert_array_equal(space.low, -space.high)


def test_observation_space_holds_the_kick_of_an_oblique_torque():
    """A sphere half a turn away spins about (1, 1, 1), at the limit, and is pushed on."""
    sphere = Spacecraft(
        inertia=(1, 1, 1), torque_levels=(2.3,), torque_axes=((1, 1, 1),), rate_limit=0.01
    )
    env = AttitudeEnv(0, spacecraft=sphere)
    axis = jnp.ones(3) / 3**0.5
    state = EnvState(jnp.append(axis, 0), 0.00999 * axis, jnp.array(3))
    observation = env.step_env(None, state, 1, env.default_params)[0]
    assert env.observation_space(env.default_params).contains(observation)
    assert abs(observation[7]) > 0.0097  # q_s: half the rate, all of it about the one axis
