"""What asks Gymnasium's environments for pictures: its wrappers, and videos."""

import sys

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", minversion="1.4")

from gymnasium import wrappers  # noqa: E402
from gymnasium.error import DependencyNotInstalled, ResetNeeded  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

import attjax  # noqa: E402
from attjax.wrappers.gymnasium import ID, SlewEnv, SlewVectorEnv  # noqa: E402

MAKERS = {"make": gymnasium.make, "make_vec": lambda id, **o: gymnasium.make_vec(id, 2, **o)}
each = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)


def frames(env):
    drawn = env.render()
    return [drawn] if isinstance(drawn, np.ndarray) else list(drawn)


@each
def test_no_render_mode_draws_nothing_and_says_so(make):
    env = make(ID, render_mode=None)
    env.reset(seed=0)
    with pytest.warns(UserWarning, match="render"):
        assert env.unwrapped.render() is None


@each
@pytest.mark.filterwarnings("error")
def test_pictures_follow_the_spacecraft(make):
    env = make(ID, render_mode="rgb_array", frameskip=5, max_episode_steps=30)
    assert env.render_mode == "rgb_array"
    assert env.metadata["render_fps"] == pytest.approx(40)
    with pytest.raises(ResetNeeded):
        env.unwrapped.render()
    env.reset(seed=0)
    first = frames(env)
    actions = np.zeros(getattr(env, "num_envs", ()), int)
    for _ in range(10):
        env.step(actions + 1)
    later = frames(env)
    for a, b in zip(first, later, strict=True):
        assert a.shape == (360, 640, 3) and a.dtype == np.uint8
        assert np.any(a != b)
    if len(first) == 2:
        assert np.any(first[0] != first[1])
    for _ in range(35):  # over an episode's end
        _, _, _, truncated, _ = env.step(actions)
        if np.any(truncated) and not hasattr(env, "num_envs"):
            env.reset()
    frames(env)


@pytest.mark.filterwarnings("error")
def test_gymnasiums_checker_draws_without_warnings():
    check_env(gymnasium.make(ID, render_mode="rgb_array").unwrapped)


def test_stepping_on_after_the_end_can_be_drawn():
    env = SlewEnv(render_mode="rgb_array")
    env.reset(seed=0)
    env._state = env._state.replace(time=env._state.time + 499)
    for _ in range(3):
        env.step(0)
    assert env.render().shape == (360, 640, 3)


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for package, name in ((attjax.wrappers, "rendering"), (attjax, "canvas")):  # as if not imported
        monkeypatch.delitem(sys.modules, f"{package.__name__}.{name}", raising=False)
        monkeypatch.delattr(package, name, raising=False)
    for make in (SlewEnv, SlewVectorEnv):
        make()
        with pytest.raises(DependencyNotInstalled, match=r"^render_mode='rgb_array' needs mat"):
            make(render_mode="rgb_array")


@each
@pytest.mark.filterwarnings("ignore")  # under SAME_STEP the last frame is missing, as is said
def test_videos_are_recorded(make, tmp_path):
    pytest.importorskip("moviepy")
    env = make(ID, render_mode="rgb_array", max_episode_steps=5)
    single = not hasattr(env, "num_envs")
    record = wrappers.RecordVideo if single else wrappers.vector.RecordVideo
    env = record(env, str(tmp_path / "videos"), episode_trigger=lambda episode: True)
    env.reset(seed=0)
    for _ in range(12):
        if np.any(env.step(env.action_space.sample())[3]) and single:
            env.reset()
    env.close()
    videos = list(tmp_path.glob("videos/*.mp4"))
    assert len(videos) >= 2 and all(video.stat().st_size > 1000 for video in videos)


@each
def test_a_window_shows_it(make, monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    if make is gymnasium.make:
        with pytest.warns(UserWarning, match="HumanRendering"):
            env = make(ID, render_mode="human")
    else:
        pytest.importorskip("cv2")
        env = wrappers.vector.HumanRendering(make(ID, render_mode="rgb_array"))
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()


def test_frames_are_collected():
    env = gymnasium.make(ID, render_mode="rgb_array_list")
    env.reset(seed=0)
    env.step(0)
    assert [frame.shape for frame in env.render()] == [(360, 640, 3)] * 2
