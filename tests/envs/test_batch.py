"""Batches: their step, and the fused open-loop rollout."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv
from attjax.envs import batch

ENV = AttitudeEnv(frameskip=5)
CONTINUOUS = AttitudeEnv(frameskip=5, actions="continuous")
INERTIA = np.array([0.872, 0.115, 0.797])


def fleet(count, max_steps=1750):
    params = ENV.default_params.replace(max_steps_in_episode=jnp.int32(max_steps))
    keys = jax.random.split(jax.random.key(1), count)
    return params, jax.vmap(ENV.reset, (0, None))(keys, params)[1]


def test_step_is_the_environment_s_own_but_for_the_fresh_episodes():
    params, states = fleet(64, max_steps=3)
    states = states.replace(time=jnp.arange(64) % 3)
    actions = jax.random.randint(jax.random.key(3), (64,), 0, 19)
    ours = batch.step(ENV, params, jax.random.key(4), states, actions)
    keys = jax.random.split(jax.random.key(5), 64)
    expected = jax.vmap(ENV.step, (0, 0, 0, None))(keys, states, actions, params)
    ended = np.asarray(states.time == 2)
    for a, b in zip(ours[2:], expected[2:]):
        jax.tree.map(lambda x, y: np.testing.assert_allclose(x, y, atol=1e-5), a, b)
    for a, b in zip(jax.tree.leaves(ours[:2]), jax.tree.leaves(expected[:2])):
        np.testing.assert_allclose(a[~ended], b[~ended], atol=1e-6)
    fresh_observation, fresh = jax.tree.map(lambda x: x[ended], ours[:2])
    assert not fresh.time.any() and not fresh.angular_velocity.any()
    assert len(np.unique(fresh.quaternion[:, 3])) == ended.sum()
    np.testing.assert_array_equal(fresh_observation[:, :4], fresh.quaternion)


@pytest.mark.parametrize("num_devices", [1, 2])
def test_open_loop_sums_what_single_steps_give(num_devices):
    params, states = fleet(32)
    actions = jax.random.randint(jax.random.key(3), (20, 32), 0, 19)
    expected, reward = states, 0.0
    step = jax.jit(batch.step, static_argnums=0)
    for action in actions:
        _, expected, r, _, _, _ = step(ENV, params, jax.random.key(0), expected, action)
        reward += r
    final, observation, totals = batch.open_loop(
        ENV, params, jax.random.key(4), states, actions, num_devices=num_devices
    )
    np.testing.assert_allclose(final.quaternion, expected.quaternion, atol=1e-5)
    np.testing.assert_allclose(observation[:, 8:], expected.angular_velocity, atol=1e-5)
    np.testing.assert_allclose(totals.reward, reward, atol=1e-3)
    assert not totals.episodes.any()


def test_open_loop_restarts_and_counts_episodes():
    params, states = fleet(32, max_steps=4)
    actions = jnp.zeros((10, 32), int)
    final, _, totals = batch.open_loop(ENV, params, jax.random.key(4), states, actions)
    assert set(np.asarray(totals.episodes)) == {2}
    assert set(np.asarray(final.time)) == {2}


def three_axes(steps, count):
    """Continuous actions, and the momenta that they leave a spacecraft with that is at rest."""
    actions = jax.random.uniform(jax.random.key(3), (steps, count, 3), minval=-1, maxval=1)
    return actions, 0.5 / 240 * np.asarray(actions).sum(0)


@pytest.mark.parametrize("num_devices", [1, 2])
def test_open_loop_takes_torques_about_three_axes(num_devices):
    params, states = fleet(32)
    actions, momenta = three_axes(20, 32)
    expected, reward = states, 0.0
    step = jax.jit(batch.step, static_argnums=0)
    for action in actions:
        _, expected, r, _, _, _ = step(CONTINUOUS, params, jax.random.key(0), expected, action)
        reward += r
    np.testing.assert_allclose(INERTIA * expected.angular_velocity, momenta, atol=1e-3)
    final, observation, totals = batch.open_loop(
        CONTINUOUS, params, jax.random.key(4), states, actions, num_devices=num_devices
    )
    np.testing.assert_allclose(final.quaternion, expected.quaternion, atol=1e-5)
    np.testing.assert_allclose(observation[:, 8:], expected.angular_velocity, atol=1e-5)
    np.testing.assert_allclose(totals.reward, reward, atol=1e-3)


def test_blocks_keep_the_torques_with_their_spacecraft(monkeypatch):
    monkeypatch.setattr(batch, "CPU_BLOCK", 8)
    params, states = fleet(24)
    actions, momenta = three_axes(2, 24)
    final, _, _ = batch.open_loop(CONTINUOUS, params, jax.random.key(4), states, actions)
    np.testing.assert_allclose(INERTIA * final.angular_velocity, momenta, atol=2e-5)
