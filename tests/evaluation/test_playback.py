"""The page of eval.py --playback: what it holds. What it does: test_playback_browser.py."""

import os
import re
from html.parser import HTMLParser

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from commands import eval_script, one_line_error
from pages import CONTROLLERS, ENV, HOSTILE, embedded

import attjax
from attjax import AttitudeEnv, evaluation
from attjax.evaluation import paper
from attjax.evaluation.playback import page as playback


def test_the_page_holds_the_recorded_flights():
    """Of a spacecraft of one's own: a full inertia tensor, other torques, limits and duration."""
    env = AttitudeEnv(frameskip=11)
    torques = 0.3 * jnp.array([[0, 0, 0], [1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    params = env.default_params.replace(
        inertia=jnp.diag(jnp.array([0.5, 0.6, 0.7])) + 0.05,
        torque_table=torques,
        rate_limit=jnp.array(0.4),
        goal_angle=jnp.array(0.01),
        max_steps_in_episode=jnp.array(80, jnp.int32),
    )
    data = embedded(playback.page(CONTROLLERS, env, params, 3, "mine"))
    assert data["controllers"] == list(CONTROLLERS) and data["checkpoint"] == "mine"
    assert data["version"] == attjax.__version__ and data["seed"] == 3
    assert data["steps"] == 80 and data["frameskip"] == 11 and data["controlPeriod"] == 0.05
    np.testing.assert_array_equal(data["inertia"], params.inertia)
    assert data["rateLimit"] == np.float32(0.4) and data["goalAngle"] == np.float32(0.01)
    assert data["pulse"] == 1 / 240

    evaluated = evaluation.random_slews(env, params, jax.random.key(3), 500)[1]
    starts = jax.tree.map(
        lambda test, random: jnp.concatenate([test, random[: playback.RANDOM_SLEWS]]),
        paper.table_5_slews(),
        evaluated,
    )
    for samples, controller in zip(data["flights"].swapaxes(0, 1), CONTROLLERS.values()):
        samples = samples.swapaxes(0, 1)  # (steps + 1, slews, 10)
        history = evaluation.record(controller, env, params, jax.random.key(3), starts, 80)
        np.testing.assert_array_equal(samples[0, :, :4], starts.quaternion)
        np.testing.assert_array_equal(samples[0, :, 4:7], 0)
        np.testing.assert_array_equal(samples[1:, :, :4], history.quaternion)
        np.testing.assert_array_equal(samples[1:, :, 4:7], history.angular_velocity)
        np.testing.assert_array_equal(samples[:-1, :, 7:], history.torque)
        assert history.torque.any() and not samples[-1, :, 7:].any()
    angles = 2 * np.arccos(data["flights"][:, 0, 0, 3])
    assert [name.split(": ")[1] for name in data["slews"]] == [
        f"{angle:.1f}°" for angle in np.rad2deg(angles)
    ]


class Elements(HTMLParser):
    """The start tags of a page, with their attributes."""

    def __init__(self, page):
        super().__init__()
        self.found = []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.found.append((tag, dict(attributes)))


@pytest.fixture(scope="module")
def page():
    params = ENV.default_params.replace(max_steps_in_episode=jnp.array(4, jnp.int32))
    return playback.page(CONTROLLERS, ENV, params, 0, HOSTILE + "\udcff")


def test_the_page_needs_nothing_else(page):
    assert not re.search(r"https?:|//[\w.]+\.\w|@import|url\(|fetch\(|XMLHttp|WebSocket", page)
    links = [v for _, a in Elements(page).found for k, v in a.items() if k in ("src", "href")]
    assert links == ["data:,"]
    assert "default-src 'none'" in page


def test_a_hostile_name_stays_text(page):
    assert embedded(page)["checkpoint"] == HOSTILE + "\udcff"
    assert [tag for tag, _ in Elements(page).found].count("script") == 2
    page.encode()  # a name that is no UTF-8 must not end the writing


@pytest.mark.parametrize(
    "flags, shown",
    [
        (["--controller", "phase-plane"], ["phase-plane", "feedback"]),
        (["--controller", "feedback"], ["feedback", "phase-plane"]),
        ([], ["policy", "phase-plane"]),
        (["--compare"], ["policy", "phase-plane"]),
    ],
)
def test_two_controllers_side_by_side(trained, flags, shown, tmp_path, capsys):
    path = tmp_path / "slews.html"
    flags = [*flags, "--checkpoint", str(trained[0]), "--playback", str(path)]
    small = ["--episodes", "3", "--duration", "2", "--seed", "5", "--device", "cpu"]
    assert eval_script.main([*small, *flags]) == 0
    assert f"wrote {path}\n" in capsys.readouterr().out
    assert os.listdir(tmp_path) == ["slews.html"]
    data = embedded(path.read_text(encoding="utf-8"))
    assert data["controllers"] == shown and data["seed"] == 5
    assert data["checkpoint"] == ("ckpt" if "policy" in shown else None)
    different = data["flights"][:, 0, :, 7:] != data["flights"][:, 1, :, 7:]
    assert data["steps"] == 80 and different.any()


def test_a_file_that_cannot_be_written_is_refused_before_the_work(tmp_path, no_work, capsys):
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    before = sorted(os.listdir(tmp_path))
    for path, reason in (
        (tmp_path, "no ordinary file"),
        (fifo, "no ordinary file"),
        ("/dev/null", "no ordinary file"),
        (tmp_path / "no" / "x.html", "No such file"),
        (tmp_path / ("x" * 300), "too long"),
        ("/proc/x.html", "No such file"),
    ):
        flags = ["--controller", "feedback", "--device", "cpu", "--playback", str(path)]
        error = one_line_error(eval_script.main, flags, capsys)
        assert f"--playback {path}" in error and reason in error
        assert sorted(os.listdir(tmp_path)) == before


def test_slews_that_are_too_long_are_refused_before_the_work(tmp_path, no_work, capsys):
    path = tmp_path / "slews.html"
    flags = ["--controller", "feedback", "--device", "cpu", "--playback", str(path)]
    error = one_line_error(eval_script.main, [*flags, "--duration", "501"], capsys)
    assert "at most 20,000 agent steps, and these have 20,040" in error
    assert not path.exists()
