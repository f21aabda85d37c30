"""``attjax/SlewContinuous-v0``: Gymnasium's checker and own vector, and what is refused."""

import jax.numpy as jnp
import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

from attjax import AttitudeEnv  # noqa: E402
from attjax.wrappers.gymnasium import CONTINUOUS_ID, ID, SlewEnv, SlewVectorEnv  # noqa: E402

pytestmark = pytest.mark.filterwarnings("error")
BOX = gymnasium.spaces.Box(-1, 1, (3,), np.float32)
KICK = 0.5 / 240 / np.array([0.872, 0.115, 0.797])


def flown(env, *actions):
    """The rates (3,) after these actions, from rest."""
    env.reset(seed=0)
    return [env.step(action)[0][..., 8:] for action in actions][-1]


@pytest.mark.parametrize("options", [{}, {"frameskip": 5, "reward": "logarithmic"}])
def test_gymnasiums_checker_passes_without_warnings(options):
    check_env(gymnasium.make(CONTINUOUS_ID, **options).unwrapped)


def test_its_spaces_and_those_of_gymnasiums_own_vector():
    single = gymnasium.make(CONTINUOUS_ID)
    assert single.action_space == BOX and single.action_space.dtype == np.float32
    ours = gymnasium.make_vec(CONTINUOUS_ID, 4)
    theirs = gymnasium.make_vec(CONTINUOUS_ID, 4, vectorization_mode="sync")
    assert isinstance(ours, SlewVectorEnv)
    for name in ("observation", "action", "single_observation", "single_action"):
        assert getattr(ours, f"{name}_space") == getattr(theirs, f"{name}_space")
    assert isinstance(gymnasium.make(ID).action_space, gymnasium.spaces.Discrete)


def test_a_pulse_about_each_axis():
    env = SlewEnv(frameskip=0, actions="continuous")
    rates = flown(env, np.array([0.5, 0, -1], np.float32))
    np.testing.assert_allclose(rates, KICK * [0.5, 0, -1], rtol=1e-3, atol=1e-7)
    vector = SlewVectorEnv(2, frameskip=0, actions="continuous")
    rates = flown(vector, np.array([[0.5, 0, 0], [0, 0.1, 0]], np.float32))
    np.testing.assert_allclose(rates, KICK * [[0.5, 0, 0], [0, 0.1, 0]], rtol=1e-5)


def test_a_vector_steps_as_gymnasiums_own_vector_of_single_ones():
    ours = gymnasium.make_vec(CONTINUOUS_ID, 3, max_episode_steps=4)
    theirs = gymnasium.make_vec(
        CONTINUOUS_ID,
        3,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": AutoresetMode.SAME_STEP},
        max_episode_steps=4,
    )
    seeds = [4, 5, 6]
    np.testing.assert_array_equal(ours.reset(seed=seeds)[0], theirs.reset(seed=seeds)[0])
    ours.action_space.seed(0)
    for step in range(4):
        actions = ours.action_space.sample()
        a, b = ours.step(actions), theirs.step(actions)
        assert a[3].all() == (step == 3)
        if not a[3].any():
            np.testing.assert_allclose(a[0], b[0], atol=1e-6)
        for x, y in zip(a[1:4], b[1:4]):
            np.testing.assert_allclose(x, y, atol=1e-5)


def test_actions_beyond_the_bounds_are_clipped_and_whole_numbers_taken():
    env = SlewEnv(actions="continuous")
    expected = flown(env, np.array([1, -1, 0], np.float32))
    for action in (
        [1.5, -1e300, 0.0],
        [1, -1, 0],
        jnp.array([1.0, -1.0, 0.0]),
        np.array([2, -9, 0]),
    ):
        np.testing.assert_array_equal(flown(env, action), expected)


@pytest.mark.parametrize(
    "action", [3, 0.5, None, "up", [0.5, 0.5], [[0.5, 0, 0]], [True] * 3, [1j] * 3, [np.nan, 0, 0]]
)
def test_other_actions_are_refused(action):
    env, envs = SlewEnv(actions="continuous"), SlewVectorEnv(1, actions="continuous")
    with pytest.raises(ValueError, match=r"^action .*; it must be (\(3,\) real numbers|finite)$"):
        flown(env, action)
    with pytest.raises(ValueError, match=r"^actions .*; it must be (\(1, 3\) real num.*|finite)$"):
        flown(envs, [action] if np.ndim(action) == 1 else action if np.ndim(action) == 0 else [])


def test_masks_are_for_discrete_actions():
    for env in (SlewEnv(actions="continuous"), SlewVectorEnv(2, actions="continuous")):
        env.reset(seed=0)
        with pytest.raises(ValueError, match=r"^action_masks: continuous actions have none$"):
            env.action_masks()


def test_an_environment_of_ones_own_says_which_actions():
    own = AttitudeEnv(5, actions="continuous")
    for make in (SlewEnv, SlewVectorEnv):
        space = make(env=own)
        space = getattr(space, "single_action_space", space.action_space)
        assert space == BOX
        with pytest.raises(ValueError, match=r"^actions is 'discrete'; env has 'continuous' ones$"):
            make(env=own, actions="discrete")
        with pytest.raises(ValueError, match="actions is 'both'; it must be 'discrete' or 'cont"):
            make(actions="both")
    with pytest.raises(ValueError, match=r"^actions is 'continuous'; env has 'discrete' ones$"):
        gymnasium.make(CONTINUOUS_ID, env=AttitudeEnv())


def test_float64_is_told_to_gymnasium_as_float32(x64):
    env = SlewVectorEnv(2, frameskip=0, actions="continuous")
    rates = flown(env, np.ones((2, 3), np.float32) / 4)
    assert rates.dtype == np.float32 and env._state.quaternion.dtype == np.float64
    np.testing.assert_allclose(rates, [KICK / 4] * 2, rtol=1e-3)
