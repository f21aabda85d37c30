import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv, EnvState, Spacecraft
from attjax.envs import observation
from attjax.envs.reward import logarithmic_reward

pytestmark = pytest.mark.usefixtures("strict_promotion")

ENV = AttitudeEnv(frameskip=5)


def spinning(rate, time=0, degrees=90.0):
    """A state that turns about the major axis, so that coasting keeps its rate."""
    half = np.deg2rad(degrees) / 2
    return EnvState(
        quaternion=jnp.array([np.sin(half), 0, 0, np.cos(half)], float),
        angular_velocity=jnp.array([rate, 0, 0], float),
        time=jnp.array(time, jnp.int32),
    )


def test_observation_is_equation_11(x64):
    q, w = np.array([0.1, -0.7, 0.5, 0.5]), np.array([0.3, -0.2, 0.1])
    obs = observation.observe(jnp.array(q), jnp.array(w))
    vector_rate = 0.5 * (q[3] * w + np.cross(q[:3], w))
    expected = [*q, *vector_rate, -0.5 * q[:3] @ w, *w]
    np.testing.assert_allclose(obs, expected, atol=1e-16)


# rate, time before the step, φ at the end -> terminated, truncated, success, reward
COMBINATIONS = [
    (0.49, 10, 90.0, False, False, None),
    (0.51, 10, 90.0, True, False, -50.0),
    (0.0, 1749, 90.0, False, True, 0.0),
    (0.0, 1749, 0.2, False, True, 50.0),
    (0.51, 1749, 0.2, True, False, -50.0),  # overspeed wins
    (0.0, 1748, 0.2, False, False, None),
]


def test_every_combination_of_terminated_and_truncated_under_jit_and_vmap():
    rates, times, angles, terminated, truncated, rewards = zip(*COMBINATIONS)
    batch = jax.tree.map(lambda *x: jnp.stack(x), *map(spinning, rates, times, angles))
    keys = jax.random.split(jax.random.key(0), len(rates))
    step = jax.jit(jax.vmap(ENV.step, (0, 0, None, None)))
    params = ENV.default_params
    obs, state, reward, ended, cut, info = step(keys, batch, 0, params)
    np.testing.assert_array_equal(ended, terminated)
    np.testing.assert_array_equal(cut, truncated)
    np.testing.assert_array_equal(info["outcome"]["overspeed_rate"], terminated)
    np.testing.assert_array_equal(info["outcome"]["success_rate"], [0, 0, 0, 1, 0, 0])
    for value, expected in zip(reward, rewards):
        assert expected is None or value == expected
    done = np.array(terminated) | np.array(truncated)
    np.testing.assert_array_equal(state.time, np.where(done, 0, np.array(times) + 1))
    np.testing.assert_array_equal(obs[~done], info["final_observation"][~done])
    np.testing.assert_array_equal(state.angular_velocity[done], 0)
    # the ended episodes' last observations survive the reset
    np.testing.assert_allclose(info["final_observation"][:, 8], rates, atol=1e-6)


def test_ordinary_reward_at_the_time_limit_for_learners_that_bootstrap():
    env = AttitudeEnv(frameskip=5, reward=logarithmic_reward)
    key, params = jax.random.key(0), env.default_params
    _, _, before, _, cut_before, _ = env.step(key, spinning(0.0, 10), 0, params)
    _, _, at_limit, _, cut, info = env.step(key, spinning(0.0, 1749), 0, params)
    assert cut and not cut_before
    assert at_limit == before
    assert info["score"] == 0  # the paper's reward is reported whatever is learned from


def test_auto_reset_draws_a_fresh_slew_each_time():
    step = jax.jit(ENV.step)
    params = ENV.default_params
    seen = set()
    for seed in range(20):
        _, state, *_ = step(jax.random.key(seed), spinning(0.51), 0, params)
        seen.add(tuple(np.asarray(state.quaternion).tolist()))
    assert len(seen) == 20


def test_step_env_and_step_agree_and_follow_gymnax():
    params, key = ENV.default_params, jax.random.key(3)
    obs, state = ENV.reset(key, params)
    assert obs.shape == (11,) and ENV.num_actions == 19 and ENV.name == "AttitudeEnv"
    five, six = ENV.step_env(key, state, 4, params), ENV.step(key, state, 4, params)
    assert len(five) == 5 and len(six) == 6
    np.testing.assert_array_equal(five[0], six[0])
    assert five[2] == six[2]
    assert ENV.observation_space(params).contains(six[0])
    assert ENV.observation_space(params).shape == (11,)
    space = ENV.action_space(params)
    assert space.n == 19 and space.contains(space.sample(key))
    assert not space.contains(19) and not space.contains(0.5)


def test_a_reward_sees_the_impulse_of_a_torque_for_as_long_as_it_acts():
    seen = []
    for held, duration in ((False, 1 / 240), (True, 24 / 240)):
        spacecraft = Spacecraft(torque_levels=(0.003,), torque_held=held)
        env = AttitudeEnv(23, lambda transition: transition.impulse, spacecraft=spacecraft)
        impulse = env.step_env(None, spinning(0.0), 4, env.default_params)[2]
        np.testing.assert_allclose(impulse, [0, -0.003 * duration, 0], rtol=1e-6)
        seen.append(float(impulse[1]))
    assert seen[1] == pytest.approx(24 * seen[0])


def test_reward_compares_with_the_quaternion_of_the_state_passed_in():
    """The state is Markov: there is no memory of an earlier q_s."""
    params, key = ENV.default_params, jax.random.key(0)
    approaching = spinning(-0.1, degrees=60.0)
    _, _, reward, *_ = ENV.step(key, approaching, 0, params)
    assert reward > 0
    replaced = approaching.replace(quaternion=spinning(0.0, degrees=20.0).quaternion)
    _, _, closer_reward, *_ = ENV.step(key, replaced, 0, params)
    assert closer_reward > reward
    receding = replaced.replace(angular_velocity=-replaced.angular_velocity)
    _, _, receding_reward, *_ = ENV.step(key, receding, 0, params)
    assert receding_reward < 0


def test_all_parameters_can_be_vmapped():
    params = ENV.default_params
    batch = jax.tree.map(lambda x: jnp.stack([x] * 3), params)
    scales = jnp.array([1.0, 2.0, 4.0])
    batch = batch.replace(
        inertia=batch.inertia * scales[:, None],
        max_steps_in_episode=jnp.array([1, 2, 3], jnp.int32),
        rate_limit=jnp.array([1.0, 1.0, 1e-6]),
    )
    keys = jax.random.split(jax.random.key(0), 3)
    _, state = jax.vmap(ENV.reset)(keys, batch)
    _, _, _, terminated, truncated, info = jax.jit(jax.vmap(ENV.step, (0, 0, None, 0)))(
        keys, state, 1, batch
    )
    rates = info["final_observation"][:, 8]
    np.testing.assert_allclose(rates, rates[0] / scales, rtol=1e-5)
    np.testing.assert_array_equal(truncated, [True, False, False])
    np.testing.assert_array_equal(terminated, [False, False, True])


def test_spacecraft_of_a_batch_may_act_at_their_own_rates():
    env, key = AttitudeEnv(frameskip=20), jax.random.key(0)
    params = env.default_params.replace(frameskip=jnp.array([5, 20]))
    axes = jax.tree.map(lambda _: None, env.default_params).replace(frameskip=0)
    _, state = env.reset(key, env.default_params)
    step = jax.jit(jax.vmap(env.step_env, (None, None, None, axes)))
    _, after, *_ = step(key, state, 1, params)
    periods = jax.vmap(env.context, (axes,))(params).control_period
    for row, frameskip in enumerate((5, 20)):
        own = AttitudeEnv(frameskip)
        assert float(periods[row]) == pytest.approx(own.control_period)
        _, expected, *_ = own.step_env(key, state, 1, own.default_params)
        np.testing.assert_allclose(after.quaternion[row], expected.quaternion, atol=1e-7)
        np.testing.assert_allclose(
            after.angular_velocity[row], expected.angular_velocity, rtol=1e-5, atol=1e-9
        )


def test_works_in_float64(x64):
    env = AttitudeEnv(frameskip=20)
    key, params = jax.random.key(0), env.default_params
    obs, state = env.reset(key, params)
    obs, state, reward, *_ = jax.jit(env.step)(key, state, 1, params)
    assert obs.dtype == state.quaternion.dtype == reward.dtype == jnp.float64


def test_environments_are_hashable_static_arguments():
    assert hash(AttitudeEnv(5)) == hash(ENV) and AttitudeEnv(5) == ENV != AttitudeEnv(6)
    with pytest.raises(dataclasses.FrozenInstanceError):
        ENV.frameskip = 3


def scores_and_improvement(dtype, quaternion, angular_velocity, action):
    """Eq. 12-13 of one step from each state, and the relative change of sin²(φ/2)."""
    env = AttitudeEnv(frameskip=20)
    params = env.default_params

    def one(q, w, a):
        state = EnvState(q, w, jnp.zeros((), jnp.int32))
        _, after, reward, terminated, _ = env.step_env(None, state, a, params)
        before, later = (jnp.sum(x[:3] ** 2) / jnp.sum(x**2) for x in (q, after.quaternion))
        return reward, terminated, (later - before) / before, after.quaternion

    arrays = (jnp.array(quaternion, dtype), jnp.array(angular_velocity, dtype), jnp.array(action))
    return [np.asarray(x) for x in jax.jit(jax.vmap(one))(*arrays)]


def test_float32_takes_the_same_reward_branches_as_float64():
    """Step by step from the same states, from 1e-7 rad to 150°; only ties may differ."""
    rng = np.random.default_rng(0)
    n = 100_000
    axis, spin = rng.normal(size=(2, n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    half = 10 ** rng.uniform(-7, np.log10(np.deg2rad(75)), (n, 1))
    quaternion = np.hstack([axis * np.sin(half), np.cos(half)]).astype(np.float32)
    rate = 10 ** rng.uniform(-7, np.log10(0.6), (n, 1))
    angular_velocity = (spin / np.linalg.norm(spin, axis=1, keepdims=True) * rate).astype("f4")
    action = rng.integers(0, 19, n)
    single, ended, _, _ = scores_and_improvement(jnp.float32, quaternion, angular_velocity, action)
    with jax.enable_x64(True):
        double, ended_double, change, after = scores_and_improvement(
            jnp.float64, quaternion, angular_velocity, action
        )
    angle = 2 * np.arctan2(np.linalg.norm(after[:, :3], axis=1), after[:, 3])
    differ = np.abs(single - double) > 1e-4
    tied = np.abs(change) < 5e-7
    tied |= np.abs(angle / np.deg2rad(0.25) - 1) < 1e-6
    assert not np.any(differ & ~tied)
    assert np.mean(differ) < 1e-3 and np.mean(tied) < 0.02
    assert np.mean(ended == ended_double) > 0.9999 and 0.01 < ended.mean() < 0.5
    # every branch was visited
    assert set(double[ended_double]) == {-50.0}
    assert (
        min((double > 9).mean(), (double < 0).mean(), ((double > 0) & (double < 1)).mean()) > 0.02
    )
