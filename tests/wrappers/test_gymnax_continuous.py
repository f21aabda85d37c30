"""Continuous actions through gymnax's own classes, and rejax's TD3 on them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

gymnax = pytest.importorskip("gymnax")

from gymnax import wrappers  # noqa: E402
from gymnax.environments import spaces  # noqa: E402

from attjax import AttitudeEnv  # noqa: E402
from attjax.wrappers.gymnax import FiveValueEnv, GymnaxEnv  # noqa: E402

KEY = jax.random.key(0)
OWN = AttitudeEnv(20, actions="continuous")


def test_the_space_is_of_gymnaxs_class():
    env = GymnaxEnv(OWN)
    for space in (env.action_space(env.default_params), env.action_space()):
        assert isinstance(space, spaces.Box) and space.shape == (3,)
        np.testing.assert_array_equal([space.low, space.high], [[-1] * 3, [1] * 3])
        assert space.contains(space.sample(KEY))
    assert isinstance(GymnaxEnv().action_space(), spaces.Discrete)
    with pytest.raises(AttributeError, match="there is no number of continuous actions"):
        env.num_actions  # noqa: B018


@pytest.mark.parametrize("kind", [GymnaxEnv, FiveValueEnv])
def test_it_steps_as_the_environment_itself(kind):
    env, params, action = kind(OWN), OWN.default_params, jnp.array([0.5, -2.0, 1e-3])
    _, state = env.reset(KEY, params)
    ours, expected = env.step(KEY, state, action, params), OWN.step(KEY, state, action, params)
    np.testing.assert_allclose(ours[0], expected[0], atol=1e-6)
    with pytest.raises(ValueError, match="it must be floating-point"):
        env.step(KEY, state, 3, params)


@pytest.mark.skipif(not hasattr(wrappers, "LegacyStepAPIWrapper"), reason="needs six values")
def test_rollout_wrapper_flies_batches():
    from gymnax.experimental import RolloutWrapper

    env = GymnaxEnv(OWN)
    rollout = RolloutWrapper(
        lambda params, observation, key: env.action_space().sample(key), env=env, num_env_steps=6
    )
    observation, action, *_ = rollout.batch_rollout(jax.random.split(KEY, 5), None)
    assert observation.shape == (5, 6, 11) and action.shape == (5, 6, 3)
    assert np.all(np.abs(action) <= 1)


def test_rejaxs_td3_runs():
    rejax = pytest.importorskip("rejax")
    params = OWN.default_params.replace(max_steps_in_episode=20)
    algorithm = rejax.TD3.create(
        env=FiveValueEnv(OWN, 0.01),
        env_params=params,
        num_envs=4,
        buffer_size=256,
        fill_buffer=64,
        batch_size=16,
        total_timesteps=256,
        eval_freq=256,
    )
    with jax.legacy_prng_key("allow"):  # of its replay buffer
        state, (_, returns) = jax.jit(algorithm.train)(KEY)
    assert state.global_step >= 256 and np.all(np.isfinite(returns))
    leaves = jax.tree.leaves(state.actor_ts.params)
    assert all(np.all(np.isfinite(x)) for x in leaves)
