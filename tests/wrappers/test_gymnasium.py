"""Gymnasium's checkers, its own vector as the model of ours, seeds, and what is refused."""

import jax
import jax.numpy as jnp
import numpy as np
import programs
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.error import ResetNeeded  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode, SyncVectorEnv  # noqa: E402
from gymnasium.wrappers import vector as wrappers  # noqa: E402

from attjax import AttitudeEnv, EnvState  # noqa: E402
from attjax.wrappers import compiled  # noqa: E402
from attjax.wrappers.gymnasium import ID, SlewEnv, SlewVectorEnv  # noqa: E402

pytestmark = pytest.mark.filterwarnings("error")
SAME_STEP = {"autoreset_mode": AutoresetMode.SAME_STEP}


def make_vec(num_envs=4, **options):
    return gymnasium.make_vec(ID, num_envs=num_envs, **options)


def short(max_steps):
    """Parameters of a slew cut short."""
    limit = jnp.array(max_steps, jnp.int32)
    return AttitudeEnv().default_params.replace(max_steps_in_episode=limit)


@pytest.mark.parametrize("options", [{}, {"frameskip": 5, "reward": "logarithmic"}])
def test_gymnasiums_checker_passes_without_warnings(options):
    check_env(gymnasium.make(ID, **options).unwrapped)


def test_make_gives_the_checked_environment_to_its_end():
    env = gymnasium.make(ID, params=short(3))
    env.reset(seed=0)
    ends = [env.step(1)[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


def test_spaces_are_those_of_gymnasiums_own_vector():
    ours, theirs = make_vec(), make_vec(vectorization_mode="sync", vector_kwargs=SAME_STEP)
    assert isinstance(ours, SlewVectorEnv) and isinstance(theirs, SyncVectorEnv)
    for name in ("observation", "action", "single_observation", "single_action"):
        assert getattr(ours, f"{name}_space") == getattr(theirs, f"{name}_space")
    assert ours.metadata["autoreset_mode"] == theirs.metadata["autoreset_mode"]
    assert ours.single_observation_space.dtype == np.float32
    assert ours.single_action_space == gymnasium.spaces.Discrete(19)


def test_a_vector_steps_as_gymnasiums_own_vector_of_single_ones():
    """Same starts, same actions: the same results, and infos of the same build."""
    params = short(4)
    ours = make_vec(3, params=params)
    theirs = make_vec(3, params=params, vectorization_mode="sync", vector_kwargs=SAME_STEP)
    ours.reset(seed=0)
    theirs.reset(seed=1)
    for i, env in enumerate(theirs.envs):
        # a state apart: each is donated to the program that steps it
        env.unwrapped._state = jax.tree.map(lambda x, i=i: jnp.array(x[i]), ours._state)
    for step in range(4):
        actions = np.array([0, 1, 7 + step])
        a, b = ours.step(actions), theirs.step(actions)
        ended = a[2] | a[3]
        assert ended.all() == (step == 3)
        np.testing.assert_allclose(a[0][~ended], b[0][~ended], atol=1e-6)
        for x, y in zip(a[1:4], b[1:4]):
            np.testing.assert_allclose(x, y, atol=1e-5)
        assert_same_build(a[4], b[4], ended)
    for i in range(3):
        np.testing.assert_allclose(a[4]["final_obs"][i], b[4]["final_obs"][i], atol=1e-6)
        assert not np.allclose(a[4]["final_obs"][i], a[0][i], atol=1e-3)


def assert_same_build(ours, theirs, ended):
    """Masked values agree; where all ended, theirs lists nothing of the (empty) new episodes."""
    shared = set(theirs)
    assert shared <= set(ours)
    assert set(ours) == shared or ended.all()
    for name in shared:
        if isinstance(theirs[name], dict):
            assert_same_build(ours[name], theirs[name], ~ended)
        elif theirs[name].dtype != object:
            np.testing.assert_allclose(ours[name], theirs[name], atol=1e-4)
        else:
            assert ours[name].dtype == object


def test_final_observations_are_kept_where_an_episode_ended():
    envs = make_vec(3, max_episode_steps=50)
    envs.reset(seed=0)
    fast = EnvState(
        quaternion=jnp.tile(jnp.array([0.0, 0.0, 0.0, 1.0]), (3, 1)),
        angular_velocity=jnp.array([[0.0, 0, 0], [0.51, 0, 0], [0.0, 0, 0]]),
        time=jnp.array([1, 10, 49], jnp.int32),
    )
    envs._state = fast
    observations, rewards, terminated, truncated, info = envs.step(np.zeros(3, int))
    assert terminated.tolist() == [False, True, False]
    assert truncated.tolist() == [False, False, True]
    assert rewards[1] == -50 and rewards[2] == 50
    assert info["_final_obs"].tolist() == [False, True, True]
    assert info["final_obs"][0] is None
    assert info["final_obs"][1][8] == pytest.approx(0.51, abs=1e-6)
    assert observations[1][8] == 0 and envs._state.time.tolist() == [2, 0, 0]
    assert info["final_info"]["success_rate"].tolist() == [0, 0, 1]
    assert info["final_info"]["overspeed_rate"].tolist() == [0, 1, 0]


@pytest.mark.parametrize("make", [make_vec, lambda: gymnasium.make(ID)])
def test_seeds_decide_everything_and_go_on_where_none_is_given(make):
    def fly(env, seed):
        first, _ = env.reset(seed=seed)
        env.action_space.seed(0)
        later = [env.step(env.action_space.sample())[0] for _ in range(3)]
        return np.stack([first, *later, env.reset()[0]])

    env = make()
    flown = fly(env, 3)
    np.testing.assert_array_equal(flown, fly(env, 3))
    np.testing.assert_array_equal(flown, fly(make(), 3))
    assert not np.allclose(flown[0], fly(env, 4)[0])
    assert not np.allclose(flown[0], flown[-1])


def test_observations_stay_in_the_space_and_are_the_callers_own():
    envs = make_vec(256, frameskip=5, params=short(40))
    seen, _ = envs.reset(seed=0)
    before = seen.copy()
    rng = np.random.default_rng(0)
    for _ in range(100):
        observations, rewards, _, _, info = envs.step(rng.integers(0, 19, 256))
        assert observations in envs.observation_space
        if "final_obs" in info:
            finals = info["final_obs"][info["_final_obs"]]
            assert all(x in envs.single_observation_space for x in finals)
        assert observations.flags.writeable and rewards.flags.writeable
    np.testing.assert_array_equal(seen, before)


def test_gymnasiums_vector_wrappers_take_it():
    envs = wrappers.RecordEpisodeStatistics(make_vec(4, max_episode_steps=5))
    envs = wrappers.TransformReward(envs, lambda reward: 0.01 * reward)
    envs = wrappers.DictInfoToList(envs)
    envs.reset(seed=0)
    for _ in range(5):
        *_, infos = envs.step(np.zeros(4, int))
    assert [info["episode"]["l"] for info in infos] == [5] * 4
    assert all(info["final_obs"].shape == (11,) for info in infos)


def test_float64_is_told_to_gymnasium_as_float32(x64):
    env = SlewVectorEnv(2)
    observations, _ = env.reset(seed=0)
    assert observations in env.observation_space
    assert env.step(np.zeros(2, int))[0] in env.observation_space


@pytest.mark.parametrize("action", [3, np.int32(3), np.array(3), np.array([3]), jnp.array([3])])
def test_an_action_is_an_integer_or_an_array_that_holds_one(action):
    env, same = SlewEnv(), SlewEnv()
    env.reset(seed=0)
    same.reset(seed=0)
    np.testing.assert_array_equal(env.step(action)[0], same.step(3)[0])


@pytest.mark.parametrize("action", [-1, 19, 0.5, None, np.array([1, 2]), np.array([0.5])])
def test_actions_out_of_the_space_are_refused(action):
    env = SlewEnv()
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"^action is .*; it must be (from 0 to 18|an integer)$"):
        env.step(action)
    envs = SlewVectorEnv(2)
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=r"^actions .*; (each must be from 0 to 18|it must be)"):
        envs.step([action, 0] if np.ndim(action) == 0 else [[1, 2]])


def test_numpys_integers_are_taken():
    envs = SlewVectorEnv(np.int64(2), frameskip=np.uint8(20))
    assert envs.num_envs == 2
    np.testing.assert_array_equal(
        envs.reset(seed=np.int64(3))[0], SlewVectorEnv(2).reset(seed=3)[0]
    )
    np.testing.assert_array_equal(SlewEnv().reset(seed=np.uint8(3))[0], SlewEnv().reset(seed=3)[0])
    with pytest.raises(ValueError, match="num_envs is True"):
        SlewVectorEnv(True)


def test_other_bad_arguments_are_refused():
    for make in (SlewEnv, SlewVectorEnv):
        with pytest.raises(ValueError, match=r"reward is 'pape'.* 'paper', 'logarithmic' or a f"):
            make(reward="pape")
        with pytest.raises(ValueError, match="frameskip is -1"):
            make(frameskip=-1)
        with pytest.raises(ValueError, match="inertia has shape"):
            make(params=AttitudeEnv().default_params.replace(inertia=jnp.ones(2)))
        with pytest.raises(ResetNeeded):
            make().step(0)
        with pytest.raises(ValueError, match="options is"):
            make().reset(options={"reset_mask": None})
        with pytest.raises(ValueError, match="render_mode is 'human'; it must be None or 'rgb_arr"):
            make(render_mode="human")
        with pytest.raises(ValueError, match=r"rate_margin is 1\.5; it must be above 0"):
            make(rate_margin=1.5)
    for num_envs in (0, -1, 2.5, None):
        with pytest.raises(ValueError, match=f"num_envs is {num_envs}; it must be a positive int"):
            SlewVectorEnv(num_envs)
    with pytest.raises(ValueError, match="max_steps_in_episode is 0; it must be from 1"):
        SlewVectorEnv(2, max_episode_steps=0)
    for seed in ([1, 2, 3], "ab", 0.5, [1, 0.5]):
        with pytest.raises(ValueError, match=r"seed is .*; it must be an integer, or a list of 2"):
            SlewVectorEnv(2).reset(seed=seed)
    with pytest.raises(ValueError, match="autoreset_mode is 'never'; it must be 'NextStep', "):
        SlewVectorEnv(2, autoreset_mode="never")


def test_an_environment_of_ones_own():
    def always_one(transition):
        return jnp.ones(())

    envs = SlewVectorEnv(2, env=AttitudeEnv(5, reward=always_one), params=short(2))
    envs.reset(seed=0)
    assert envs.step(np.zeros(2, int))[1].tolist() == [1, 1]
    assert envs.step(np.zeros(2, int))[3].all()


def test_one_program_for_each_batch_size():
    before = programs.held(compiled.step_batch)
    for _ in range(2):
        envs = make_vec(5)
        envs.reset(seed=0)
        for _ in range(3):
            envs.step(np.zeros(5, int))
    assert 1 <= programs.held(compiled.step_batch) <= before + 1
