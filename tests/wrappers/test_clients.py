"""Libraries of reinforcement learning take the environments as they are; see docs/peers.md."""

import jax
import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", minversion="1.4")
torch = pytest.importorskip("torch")

from attjax.wrappers.gymnasium import ID, SlewVectorEnv  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(autouse=True)
def one_thread():
    torch.set_num_threads(1)


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_torchrl_rolls_a_vector_out(mode):
    envs = pytest.importorskip("torchrl.envs")
    made = gymnasium.make_vec(ID, 3, autoreset_mode=mode, max_episode_steps=5)
    flown = envs.GymWrapper(made).rollout(12, break_when_any_done=False)
    assert flown.shape == (3, 12)
    ends = flown["next", "truncated"].squeeze(-1)
    assert ends.sum(1).tolist() == [2] * 3 and ends[:, 4].all() and ends[:, 9].all()


def test_torchrl_checks_one_and_reads_its_info_and_pictures():
    envs = pytest.importorskip("torchrl.envs")
    env = envs.GymWrapper(gymnasium.make(ID, max_episode_steps=5))
    env.auto_register_info_dict()
    envs.check_env_specs(env)
    flown = env.rollout(20)
    assert flown.shape == (5,) and torch.all(flown["next", "terminal_error_deg"] > 1)
    pictures = envs.GymEnv(ID, from_pixels=True, pixels_only=False).rollout(2)["pixels"]
    assert pictures.shape == (2, 360, 640, 3)


def test_sbxs_ppo_learns_a_little():
    sbx = pytest.importorskip("sbx")
    from attjax.wrappers.sb3 import as_vec_env

    vec_env = as_vec_env(SlewVectorEnv(8), 0.01, time_limit_terminates=True)
    with jax.legacy_prng_key("allow"):  # its own keys are
        model = sbx.PPO("MlpPolicy", vec_env, n_steps=32, batch_size=64, seed=0)
        model.learn(512)
    assert model.num_timesteps == 512


@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
def test_skrl_wraps_both(mode):
    wrap = pytest.importorskip("skrl.envs.wrappers.torch").wrap_env
    env = wrap(gymnasium.make_vec(ID, 3, autoreset_mode=mode, max_episode_steps=4))
    assert env.num_envs == 3 and env.action_space.n == 19
    observations, _ = env.reset()
    ends = []
    for _ in range(9):
        observations, rewards, terminated, truncated, _ = env.step(torch.ones(3, 1, dtype=int))
        assert observations.shape == (3, 11) and rewards.shape == terminated.shape == (3, 1)
        ends.append(bool(truncated.all()))
    period = 4 if mode == "SameStep" else 5
    assert [i for i, end in enumerate(ends) if end] == list(range(3, 9, period))
    single = wrap(gymnasium.make(ID))
    single.reset()
    assert single.step(torch.ones(1, 1, dtype=int))[0].shape == (1, 11)


def test_tianshous_collector_flies_episodes():
    data = pytest.importorskip("tianshou.data")
    from tianshou.algorithm.algorithm_base import RandomActionPolicy
    from tianshou.env import DummyVectorEnv

    envs = DummyVectorEnv([lambda: gymnasium.make(ID, max_episode_steps=6)] * 2)
    buffer = data.VectorReplayBuffer(100, 2)
    collector = data.Collector(RandomActionPolicy(envs.action_space[0]), envs, buffer)
    collector.reset()
    collected = collector.collect(n_episode=4, random=True)
    assert collected.n_collected_steps == 24 and set(collected.lens) == {6}
    assert len(buffer) == 24 and buffer.truncated.sum() == 4
    assert np.all(buffer.info.terminal_error_deg[:6] > 1)


def test_a_loop_of_cleanrls_kind_records_episodes_and_videos(tmp_path):
    """A client of our own, with the calls that CleanRL's PPO makes on what its thunks return."""
    pytest.importorskip("moviepy")

    def thunk(index):
        env = gymnasium.make(ID, render_mode="rgb_array", max_episode_steps=6)
        if index == 0:
            env = gymnasium.wrappers.RecordVideo(env, str(tmp_path))
        return gymnasium.wrappers.RecordEpisodeStatistics(env)

    envs = gymnasium.vector.SyncVectorEnv(
        [lambda i=i: thunk(i) for i in range(2)], autoreset_mode="SameStep"
    )
    assert isinstance(envs.single_action_space, gymnasium.spaces.Discrete)
    observations, _ = envs.reset(seed=1)
    lengths = []
    for _ in range(13):
        actions = torch.randint(envs.single_action_space.n, (2,)).numpy()
        observations, _, _, _, infos = envs.step(actions)
        assert torch.Tensor(observations).shape == (2, 11)
        if "final_info" in infos:
            lengths += infos["final_info"]["episode"]["l"].tolist()
    envs.close()
    assert lengths == [6] * 4 and list(tmp_path.glob("*.mp4"))
