"""gymnax's own tools take the environment, and rejax's PPO learns on it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

gymnax = pytest.importorskip("gymnax")

from gymnax import wrappers  # noqa: E402
from gymnax.environments import environment, spaces  # noqa: E402

from attjax import AttitudeEnv  # noqa: E402
from attjax.wrappers.gymnax import FiveValueEnv, GymnaxEnv  # noqa: E402

KEY = jax.random.key(0)
ENVS = [AttitudeEnv(20), GymnaxEnv(AttitudeEnv(20))]
both = pytest.mark.parametrize("env", ENVS, ids=["AttitudeEnv", "GymnaxEnv"])
SIX_VALUES = hasattr(wrappers, "LegacyStepAPIWrapper")
needs_six = pytest.mark.skipif(not SIX_VALUES, reason="this gymnax unpacks five values")


def short(env, max_steps):
    return env.default_params.replace(max_steps_in_episode=jnp.array(max_steps, jnp.int32))


def test_spaces_are_of_gymnaxs_classes_and_bounds():
    env = GymnaxEnv()
    params = env.default_params
    assert isinstance(env, environment.Environment) and env.name == "AttitudeEnv"
    box, actions = env.observation_space(params), env.action_space(params)
    assert isinstance(box, spaces.Box) and isinstance(actions, spaces.Discrete)
    assert box.shape == (11,) and actions.n == env.num_actions == 19
    np.testing.assert_array_equal(box.high, AttitudeEnv().observation_space(params).high)
    observation, _ = env.reset(KEY, params)
    assert box.contains(observation) and box.contains(box.sample(KEY))


def test_it_steps_as_the_environment_itself():
    env, own = GymnaxEnv(reward_scale=0.5), AttitudeEnv()
    params = short(own, 1)
    _, state = own.reset(KEY, params)
    for step, expected in ((env.step, own.step), (env.step_env, own.step_env)):
        a, b = step(KEY, state, 1, params), expected(KEY, state, 1, params)
        assert len(a) == len(b)
        assert a[2] == pytest.approx(0.5 * float(b[2]))
        np.testing.assert_allclose(a[0], b[0], atol=1e-6)
    default = env.step(KEY, state, 1)
    assert not default[4]  # the default parameters' time limit


@needs_six
@both
def test_log_wrapper_counts_whole_episodes(env):
    wrapped, params = wrappers.LogWrapper(env), short(env, 3)
    _, state = wrapped.reset(KEY, params)
    total = 0.0
    for _ in range(3):
        _, state, reward, _, truncated, info = wrapped.step(KEY, state, 1, params)
        total += reward
    assert truncated and info["returned_episode"]
    assert info["returned_episode_lengths"] == 3
    assert info["returned_episode_returns"] == pytest.approx(float(total))


@needs_six
@both
def test_rollout_wrapper_flies_batches(env):
    from gymnax.experimental import RolloutWrapper

    def policy(params, observation, key):
        return env.action_space(env.default_params).sample(key)

    rollout = RolloutWrapper(policy, env=env, num_env_steps=6)
    observation, action, *_, total = rollout.batch_rollout(jax.random.split(KEY, 5), None)
    assert observation.shape == (5, 6, 11) and action.shape == (5, 6) and total.shape == (5, 1)


@needs_six
def test_wrappers_that_ask_for_the_class_of_a_space():
    env = GymnaxEnv()
    params = env.default_params
    flat = wrappers.FlattenObservationWrapper(env)
    assert flat.observation_space(params).shape == (11,)
    _, state = flat.reset(KEY, params)
    assert flat.step(KEY, state, 1, params)[0].shape == (11,)
    sticky = wrappers.StickyActionWrapper(env, 0.25)
    _, state = sticky.reset(KEY, params)
    assert sticky.step(KEY, state, 1, params)[0].shape == (11,)
    legacy = wrappers.LegacyStepAPIWrapper(env)
    assert len(legacy.step(KEY, legacy.reset(KEY, params)[1], 1, params)) == 5


@needs_six
@both
def test_dm_env_wrapper(env):
    wrapped, params = wrappers.GymnaxToDmEnvWrapper(env), short(env, 1)
    timestep = wrapped.step(KEY, wrapped.reset(KEY, params), 1, params)
    assert timestep.discount == 1  # the time limit is no end
    assert not np.allclose(timestep.observation, timestep.final_observation)


@needs_six
def test_gymnaxs_own_way_to_gymnasium():
    env = wrappers.GymnaxToGymWrapper(GymnaxEnv(), seed=0)
    env.reset(seed=0)
    assert env.step(1)[0].shape == env.observation_space.shape == (11,)
    envs = wrappers.GymnaxToVectorGymWrapper(GymnaxEnv(), num_envs=3, seed=0)
    envs.reset(seed=0)
    assert envs.step(jnp.zeros(3, int))[0].shape == envs.observation_space.shape == (3, 11)


@needs_six
def test_it_can_be_registered_with_gymnax():
    if "AttjaxSlew" not in gymnax.registered_envs:
        gymnax.register("AttjaxSlew", GymnaxEnv)
    env, params = gymnax.make("AttjaxSlew")
    assert env.reset(KEY, params)[0].shape == (11,)


def test_five_values_tell_both_ends_as_done():
    env = FiveValueEnv(reward_scale=0.1)
    params = short(env, 2)
    _, state = env.reset(KEY, params)
    _, state, _, done, _ = env.step(KEY, state, 1, params)
    assert not done
    _, after, reward, done, info = env.step(KEY, state, 1, params)
    assert done and after.time == 0 and reward == 0
    assert info["truncated"] and info["final_observation"].shape == (11,)
    fast = state.replace(angular_velocity=jnp.array([0.6, 0.0, 0.0]))
    _, _, reward, done, _ = env.step(KEY, fast, 1, params)
    assert done and reward == pytest.approx(-5)


def test_the_time_limit_of_the_default_is_hashable():
    params = GymnaxEnv(AttitudeEnv(5)).default_params
    assert hash(params.max_steps_in_episode) == hash(1750)
    observation, state = GymnaxEnv(AttitudeEnv(5)).reset(KEY, params)
    np.testing.assert_array_equal(observation, AttitudeEnv(5).reset(KEY)[0])
    assert not GymnaxEnv(AttitudeEnv(5)).step(KEY, state, 1)[4]


def test_info_is_gymnaxs_own_unless_more_is_asked_for():
    own = {"terminated", "truncated", "discount"}
    for describe, more in ((False, set()), (True, {"score", "torque", "outcome"})):
        env = GymnaxEnv(describe=describe)
        _, state = env.reset(KEY)
        fast = state.replace(angular_velocity=jnp.array([0.6, 0.0, 0.0]))
        for start, discount in ((state, 1), (fast, 0)):
            info = env.step_env(KEY, start, 1, env.default_params)[-1]
            assert set(info) == own | more and info["discount"] == discount
            assert set(env.step(KEY, start, 1)[-1]) == own | more | {"final_observation"}


@needs_six
def test_braxs_wrapper_keeps_one_structure():
    training = pytest.importorskip("brax.envs.wrappers.training")
    brax = pytest.importorskip("gymnax.wrappers.brax")
    env = brax.GymnaxToBraxWrapper(GymnaxEnv(AttitudeEnv(20)))
    start = jax.jit(env.reset)(KEY)
    end, rewards = jax.lax.scan(
        lambda state, _: (lambda new: (new, new.reward))(env.step(state, 1)), start, length=5
    )
    assert jax.tree.structure(end) == jax.tree.structure(start)
    assert end.pipeline_state.time == 5 and rewards.shape == (5,)
    episodes = training.EpisodeWrapper(env, episode_length=10, action_repeat=3)
    state = jax.jit(episodes.step)(jax.jit(episodes.reset)(KEY), jnp.array(1))
    assert state.info["steps"] == 3


@needs_six
def test_evosaxs_problem_flies_a_population():
    rl = pytest.importorskip("evosax.problems.rl.gymnax")
    from flax import linen

    class Linear(linen.Module):
        @linen.compact
        def __call__(self, x, key):
            return jnp.argmax(linen.Dense(19)(x), axis=-1)

    if "AttjaxSlew" not in gymnax.registered_envs:
        gymnax.register("AttjaxSlew", GymnaxEnv)
    policy = Linear()
    problem = rl.GymnaxProblem("AttjaxSlew", policy, num_rollouts=2)
    population = jax.vmap(policy.init, (0, None, None))(
        jax.random.split(KEY, 3), jnp.zeros(11), KEY
    )
    fitness, _, _ = problem.eval(KEY, population, problem.init(KEY))
    assert problem.episode_length == 500
    assert fitness.shape == (3,) and jnp.all(jnp.isfinite(fitness))


def test_stoas_adapter_steps():
    """Stoix's environments go through stoa, which unpacks five values."""
    stoa = pytest.importorskip("stoa.env_adapters.gymnax")
    env = stoa.GymnaxToStoa(FiveValueEnv(AttitudeEnv(20)))
    assert env.action_space().num_values == 19 and env.observation_space().shape == (11,)
    state, first = jax.jit(env.reset)(KEY)
    _, after = jax.lax.scan(lambda state, _: env.step(state, 0), state, length=500)
    assert first.observation.shape == (11,) and after.reward.shape == (500,)
    assert after.discount[-1] == 0 and jnp.all(after.discount[:-1] == 1)


def test_a_loop_of_purejaxrls_kind_counts_its_episodes():
    """A client of our own, with the calls that PureJaxRL's PPO makes on an environment."""
    env, count = FiveValueEnv(AttitudeEnv(20), 0.01), 4
    params = short(env, 6)
    assert env.observation_space(params).shape == (11,) and env.action_space(params).n == 19
    observations, states = jax.vmap(env.reset, (0, None))(jax.random.split(KEY, count), params)

    def step(carry, key):
        observations, states, lengths = carry
        keys = jax.random.split(key, count)
        actions = jax.random.randint(key, (count,), 0, env.action_space(params).n)
        observations, states, rewards, done, _ = jax.vmap(env.step, (0, 0, 0, None))(
            keys, states, actions, params
        )
        lengths += 1
        return (observations, states, jnp.where(done, 0, lengths)), (rewards, done, lengths)

    carry = observations, states, jnp.zeros(count, int)
    _, (rewards, done, lengths) = jax.lax.scan(step, carry, jax.random.split(KEY, 13))
    assert done.sum() == 2 * count and jnp.all(lengths[done] == 6)
    assert jnp.all(jnp.isfinite(rewards))


def test_rejaxs_ppo_learns():
    """Measured with keys 0 to 2: from -218, -233, -291 to -8, 40, -27."""
    rejax = pytest.importorskip("rejax")
    scale, steps = 0.01, 65_536
    algorithm = rejax.PPO.create(
        env=FiveValueEnv(AttitudeEnv(20), scale),
        num_envs=64,
        num_steps=64,
        num_minibatches=8,
        num_epochs=10,
        learning_rate=1e-3,
        ent_coef=0.0,
        max_grad_norm=0.5,
        agent_kwargs={"activation": "tanh"},
        total_timesteps=steps,
        eval_freq=steps,
    )
    state, (_, returns) = jax.jit(algorithm.train)(KEY)
    before, after = np.mean(returns, axis=1) / scale
    print(f"rejax: {state.global_step} steps, return {before:.1f} before, {after:.1f} after")
    assert state.global_step >= 50_000
    assert after > before + 120
