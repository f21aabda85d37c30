"""Stable-Baselines3 gets what it asks for, and its PPO learns."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")
stable_baselines3 = pytest.importorskip("stable_baselines3")

import torch  # noqa: E402
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecVideoRecorder  # noqa: E402

from attjax.wrappers.gymnasium import CONTINUOUS_ID, ID  # noqa: E402
from attjax.wrappers.sb3 import as_vec_env  # noqa: E402


def make_vec(num_envs, **options):
    return gymnasium.make_vec(ID, num_envs=num_envs, **options)


@pytest.mark.parametrize("time_limit_terminates", [False, True])
def test_infos_at_the_end_are_those_that_sb3_reads(time_limit_terminates):
    vec_env = as_vec_env(make_vec(3, max_episode_steps=2), 0.5, time_limit_terminates)
    vec_env.seed(3)
    first = vec_env.reset()
    _, _, ended, infos = vec_env.step(np.zeros(3, int))
    assert not ended.any() and {tuple(sorted(info)) for info in infos} == {
        ("is_success", "overspeed_rate", "score", "success_rate", "terminal_error_deg")
    }
    observations, rewards, ended, infos = vec_env.step(np.ones(3, int))
    assert ended.all() and rewards.dtype == np.float32 and rewards.flags.writeable
    for i, info in enumerate(infos):
        assert info["TimeLimit.truncated"] == (not time_limit_terminates)
        assert info["is_success"] == 0 and info["terminal_error_deg"] > 1
        assert "final_obs" not in info and "final_info" not in info
        # it has hardly turned from the start, but was kicked; the new episode is at rest
        np.testing.assert_allclose(info["terminal_observation"][:4], first[i][:4], atol=1e-3)
        assert info["terminal_observation"][8] > 0.002
        np.testing.assert_array_equal(observations[i][8:], 0)


def test_overspeed_is_no_time_limit_and_rewards_are_scaled():
    vec_env = as_vec_env(make_vec(1), reward_scale=0.01)
    vec_env.reset()
    vec_env.vector_env._state = vec_env.vector_env._state.replace(
        angular_velocity=np.array([[0.6, 0.0, 0.0]], np.float32)
    )
    _, rewards, ended, infos = vec_env.step(np.zeros(1, int))
    assert ended.all() and rewards[0] == pytest.approx(-0.5)
    assert infos[0]["TimeLimit.truncated"] is False


def test_seeds_and_the_rest_of_the_protocol():
    vec_env = as_vec_env(make_vec(4))
    starts = []
    for _ in range(2):
        vec_env.seed(5)
        starts.append(vec_env.reset())
    np.testing.assert_array_equal(*starts)
    assert not np.allclose(vec_env.reset(), starts[0])
    assert vec_env.get_attr("num_envs", [0, 2]) == [4, 4]
    assert not vec_env.has_attr("no_such_thing")
    vec_env.set_attr("note", 3)
    assert vec_env.get_attr("note", 1) == [3] and vec_env.vector_env.note == 3
    with pytest.raises(ValueError, match="indices is 0; all environments share note"):
        vec_env.set_attr("note", 4, 0)
    assert vec_env.env_is_wrapped(gymnasium.Wrapper) == [False] * 4
    vec_env.close()


def test_vectors_that_reset_at_the_next_step_are_refused():
    with pytest.raises(ValueError, match=r"autoreset_mode is .*NEXT_STEP; it must be .*SAME_STEP"):
        as_vec_env(make_vec(2, vectorization_mode="sync"))


def test_monitors_read_the_keywords_of_info():
    names = ("is_success", "terminal_error_deg")
    vec_env = VecMonitor(as_vec_env(make_vec(3, max_episode_steps=2)), info_keywords=names)
    vec_env.reset()
    vec_env.step(np.zeros(3, int))
    infos = vec_env.step(np.zeros(3, int))[3]
    for info in infos:
        assert info["episode"]["l"] == 2 and not info["episode"]["is_success"]
        assert info["episode"]["terminal_error_deg"] == info["terminal_error_deg"] > 1
    assert all(x["terminal_error_deg"] > 1 for x in infos)


@pytest.mark.parametrize("how", ["as_vec_env", "sync", "DummyVecEnv"])
def test_each_environment_has_its_own_mask(how):
    same_step = {"autoreset_mode": "SameStep"}
    vec_env = {
        "as_vec_env": lambda: as_vec_env(make_vec(3)),
        "sync": lambda: as_vec_env(make_vec(3, vectorization_mode="sync", vector_kwargs=same_step)),
        "DummyVecEnv": lambda: DummyVecEnv([lambda: gymnasium.make(ID)] * 3),
    }[how]()
    assert how == "sync" or vec_env.has_attr("action_masks")
    vec_env.reset()
    for _ in range(40):  # 0.1 rad/s about an axis of its own, for each: the limit of that margin
        vec_env.step(np.array([0, 1, 7]))
    masks = np.stack(vec_env.env_method("action_masks"))
    assert masks.shape == (3, 19)
    one = vec_env.env_method("action_masks", indices=[1])
    np.testing.assert_array_equal(one, masks[1:2])
    np.testing.assert_array_equal(vec_env.env_method("action_masks", indices=2), masks[2:])


def test_masks_tell_the_spacecraft_apart():
    envs = make_vec(3)
    vec_env = as_vec_env(envs)
    vec_env.reset()
    rates = np.array([[0.0, 0, 0], [0.4945, 0, 0], [0, 0, 0.4945]], np.float32)
    envs._state = envs._state.replace(angular_velocity=rates)
    masks = vec_env.env_method("action_masks")
    assert masks[0].all() and not masks[1].all() and not masks[2].all()
    assert (masks[1] != masks[2]).any()
    np.testing.assert_array_equal(vec_env.env_method("action_masks", indices=[2, 0])[0], masks[2])


def test_maskable_ppo_never_leaves_the_mask():
    maskable = pytest.importorskip("sb3_contrib")
    evaluate = pytest.importorskip("sb3_contrib.common.maskable.evaluation").evaluate_policy
    torch.set_num_threads(1)
    envs = make_vec(8, rate_margin=0.05)  # reached soon
    vec_env = VecMonitor(as_vec_env(envs, 0.01, time_limit_terminates=True))
    model = maskable.MaskablePPO("MlpPolicy", vec_env, n_steps=64, seed=0, device="cpu")
    rates = []

    def note(*_):
        rates.append(np.linalg.norm(envs._state.angular_velocity, axis=-1).max())
        return True

    model.learn(1024, callback=note)
    evaluate(model, vec_env, n_eval_episodes=8, warn=False, callback=note)
    assert 0.9 < max(rates) / (0.05 * 0.5) <= 1 + 1e-5


def test_videos_are_recorded(tmp_path):
    pytest.importorskip("moviepy")
    vec_env = as_vec_env(make_vec(2, render_mode="rgb_array"))
    vec_env.reset()
    assert vec_env.render_mode == "rgb_array" and vec_env.render().shape[2] == 3
    vec_env = VecVideoRecorder(vec_env, str(tmp_path), lambda step: step == 0, video_length=4)
    vec_env.reset()
    for _ in range(5):
        vec_env.step(np.zeros(2, int))
    vec_env.close()
    assert [video.suffix for video in tmp_path.iterdir()] == [".mp4"]


def mean_return(model, seed=7, num_envs=256):
    """Of the first episodes, with sampled actions."""
    envs = make_vec(num_envs)
    observations, _ = envs.reset(seed=seed)
    total, flying = np.zeros(num_envs), np.ones(num_envs, bool)
    while flying.any():
        actions, _ = model.predict(observations)
        observations, rewards, terminated, truncated, _ = envs.step(actions)
        total += rewards * flying
        flying &= ~(terminated | truncated)
    return total.mean()


def test_ppo_learns():
    """Measured with seeds 0 to 2: from -270, -252, -252 to 1, -11, 9."""
    torch.set_num_threads(1)
    vec_env = VecMonitor(as_vec_env(make_vec(64), 0.01, time_limit_terminates=True))
    model = stable_baselines3.PPO(
        "MlpPolicy", vec_env, n_steps=64, batch_size=512, learning_rate=1e-3, seed=0, device="cpu"
    )
    before = mean_return(model)
    model.learn(65_536)
    after = mean_return(model)
    print(f"SB3: {model.num_timesteps} steps, return {before:.1f} before, {after:.1f} after")
    assert model.num_timesteps >= 50_000
    assert after > before + 120


def test_td3_takes_continuous_actions():
    vec_env = as_vec_env(gymnasium.make_vec(CONTINUOUS_ID, num_envs=4, max_episode_steps=6), 0.01)
    assert vec_env.action_space == gymnasium.spaces.Box(-1, 1, (3,), np.float32)
    model = stable_baselines3.TD3(
        "MlpPolicy", vec_env, learning_starts=8, batch_size=8, train_freq=1, seed=0, device="cpu"
    )
    model.learn(64)
    assert model.num_timesteps == 64 and model.replay_buffer.pos == 16
    stored = model.replay_buffer.actions[:16]
    assert stored.shape == (16, 4, 3) and np.all(np.abs(stored) <= 1) and np.ptp(stored) > 1
    action, _ = model.predict(vec_env.reset(), deterministic=True)
    assert action.shape == (4, 3) and action.dtype == np.float32
