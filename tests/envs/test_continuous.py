"""Continuous torques about three axes at once: against closed forms and the rows of the table."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import attjax
from attjax import AttitudeEnv, EnvState, Spacecraft
from attjax.envs import torques

pytestmark = pytest.mark.usefixtures("strict_promotion")

INERTIA = np.array([0.872, 0.115, 0.797])
ENV = AttitudeEnv(frameskip=5, actions="continuous")
TABLE = AttitudeEnv(frameskip=5)
REST = EnvState(jnp.array([0.6, 0.0, 0.0, 0.8]), jnp.zeros(3), jnp.array(0, jnp.int32))
KEY = jax.random.key(0)


def row(number):
    """The fractions of a row of Table 1."""
    return jnp.array(TABLE.spacecraft.torque_table[number]) / 0.5


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("fraction", [1.0, -1.0, 0.25, 1e-4])
def test_a_pulse_about_one_axis_from_rest(x64, axis, fraction):
    """ω = M Δt/I, and nothing about the others."""
    action = fraction * jnp.eye(3)[axis]
    rest = jax.tree.map(jnp.asarray, EnvState(np.eye(4)[3], np.zeros(3), np.int32(0)))
    after = attjax.step(rest, action, ENV.default_params, 5)
    expected = fraction * 0.5 / 240 / INERTIA * np.eye(3)[axis]
    np.testing.assert_allclose(after.angular_velocity, expected, rtol=1e-14)
    turn = expected * (0.5 + 5) / 240  # half of the pulse at the mean rate, then coasting
    np.testing.assert_allclose(2 * after.quaternion[:3], turn, rtol=1e-4)
    assert after.time == 1 and after.quaternion.dtype == jnp.float64


def test_all_axes_at_once_give_the_sum_of_their_momenta(x64):
    action = jnp.array([0.7, -0.2, 1.0])
    rest = jax.tree.map(jnp.asarray, EnvState(np.eye(4)[3], np.zeros(3), np.int32(0)))
    after = attjax.step(rest, action, AttitudeEnv(0).default_params, 0)
    expected = np.array([0.7, -0.2, 1.0]) * 0.5 / 240 / INERTIA
    np.testing.assert_allclose(after.angular_velocity, expected, rtol=1e-2)  # but for ω × Iω
    _, _, _, _, info = ENV.step_env(KEY, rest, action, ENV.default_params)
    np.testing.assert_allclose(info["torque"], [0.35, -0.1, 0.5], rtol=1e-15)


@pytest.mark.parametrize("number", range(19))
def test_the_fractions_of_a_row_of_the_table_do_what_the_row_does(number):
    state = REST.replace(angular_velocity=jnp.array([0.1, -0.2, 0.05]))
    told = TABLE.step_env(KEY, state, number, TABLE.default_params)
    same = ENV.step_env(KEY, state, row(number), ENV.default_params)
    for a, b in zip(jax.tree.leaves(told), jax.tree.leaves(same), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-7)
    if number < 7:  # fractions that are exact
        np.testing.assert_array_equal(told[1].angular_velocity, same[1].angular_velocity)


def test_actions_are_clipped_and_have_a_gradient_within():
    params = ENV.default_params
    for beyond, within in ((3.0, 1.0), (-1.0001, -1.0)):
        far = attjax.step(REST, jnp.array([beyond, 0.3, 0.0]), params, 5)
        near = attjax.step(REST, jnp.array([within, 0.3, 0.0]), params, 5)
        np.testing.assert_array_equal(far.angular_velocity, near.angular_velocity)

    def rate(action):
        return attjax.step(REST, action, params, 5).angular_velocity[0]

    slope = jax.grad(rate)(jnp.array([0.5, 0.0, 0.0]))
    np.testing.assert_allclose(slope[0], 0.5 / 240 / INERTIA[0], rtol=1e-5)
    assert jax.grad(rate)(jnp.array([1.5, 0.0, 0.0]))[0] == 0


def test_torques_of_another_spacecraft_that_are_held():
    """The largest level about each axis, wherever it stands; none about an axis without one."""
    spacecraft = Spacecraft(
        inertia=(2, 2, 2),
        torque_levels=(0.001, 0.004),
        torque_axes=((0, 3, 0), (0, 0, -1)),
        torque_held=True,
    )
    env = AttitudeEnv(23, spacecraft=spacecraft, actions="continuous")
    params = env.default_params
    np.testing.assert_allclose(torques.largest_torques(params.torque_table), [0, 0.004, 0.004])
    after = env.step_env(KEY, REST, jnp.array([1.0, 0.5, -1.0]), params)[1]
    expected = np.array([0, 0.002, -0.004]) * 0.1 / 2
    np.testing.assert_allclose(after.angular_velocity, expected, rtol=1e-5, atol=1e-12)


def test_jit_and_vmap_and_automatic_reset():
    params = ENV.default_params.replace(max_steps_in_episode=jnp.int32(3))
    states = jax.vmap(ENV.reset, (0, None))(jax.random.split(KEY, 6), params)[1]
    states = states.replace(time=jnp.arange(6, dtype=jnp.int32) % 3)
    actions = jax.random.uniform(KEY, (6, 3), minval=-1.0, maxval=1.0)
    stepped = jax.jit(jax.vmap(ENV.step, (0, 0, 0, None)))(
        jax.random.split(KEY, 6), states, actions, params
    )
    constant = jax.jit(lambda *x: jax.vmap(ENV.step, (0, 0, 0, None))(*x, params))
    same = constant(jax.random.split(KEY, 6), states, actions)
    np.testing.assert_allclose(same[1].angular_velocity, stepped[1].angular_velocity, atol=1e-7)
    assert stepped[4].tolist() == [False, False, True] * 2
    for i in range(2):
        alone = attjax.step(jax.tree.map(lambda x, i=i: x[i], states), actions[i], params, 5)
        np.testing.assert_allclose(
            stepped[1].angular_velocity[i], alone.angular_velocity, atol=1e-7
        )


def test_spaces():
    space, params = ENV.action_space(ENV.default_params), ENV.default_params
    assert space.shape == (3,) and space.dtype == jnp.float32 and ENV.action_space().shape == (3,)
    np.testing.assert_array_equal([space.low, space.high], [[-1] * 3, [1] * 3])
    assert space.contains(space.sample(KEY)) and not space.contains(jnp.array([0.0, 0.0, 1.1]))
    assert not hasattr(ENV, "num_actions")
    with pytest.raises(AttributeError, match="num_actions: there is no number of continuous"):
        ENV.num_actions  # noqa: B018
    # A body at the rate limit that all three torques kick at once is within the bounds.
    isotropic = params.replace(inertia=jnp.full(3, 0.1))
    rate = jnp.full(3, 0.5 / 3**0.5)
    told = ENV.step_env(KEY, REST.replace(angular_velocity=rate), jnp.ones(3), isotropic)[0]
    kick = 3**0.5 * 0.5 / 240 / 0.1
    assert float(jnp.linalg.norm(told[8:])) == pytest.approx(0.5 + kick, rel=1e-5)
    high = ENV.observation_space(isotropic).high
    np.testing.assert_allclose(high[8:], 0.5 + kick, rtol=1e-5)
    np.testing.assert_array_equal(  # of the table, one axis at a time
        TABLE.observation_space(isotropic).high[8:], jnp.full(3, 0.5 + 0.5 / 240 / jnp.float32(0.1))
    )
