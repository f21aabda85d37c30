"""What the figures show beside the truth where it is not told: what was believed, and when."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.text import Text
from scipy.spatial.transform import Rotation
from worlds import world

from attjax import AttitudeEnv, World, canvas
from attjax.control import classical
from attjax.evaluation import paper, plots

STEPS = 120
NAME = "cost $1 to $2"
PUSHING = world(name=NAME, disturbances={"constant_torque": 1e-4})
NOISY = {"cross_boresight_arcsec": 2000, "roll_arcsec": 4000}


def flight(flown_in):
    env = AttitudeEnv(20, world=flown_in)
    params = env.default_params.replace(max_steps_in_episode=jnp.array(STEPS, jnp.int32))
    return plots.Flight(jax.tree_util.Partial(classical.phase_plane), env, params, 2, 8)


def seeing(**star_tracker):
    return world(name=NAME, sensors={"star_tracker": star_tracker})


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Draws all figures; their axes by the figure's name."""
    figures = {}
    monkeypatch.setattr(canvas, "save", lambda figure, _, name: figures.update({name: figure}))

    def draw(flown):
        plots.write_all(flown, tmp_path)
        return figures

    return draw


def curves(axis):
    """(samples, 2) times and values of an axis's lines, by their names."""
    return {line.get_label(): np.array(line.get_xydata()) for line in axis.lines}


def is_title(artist):
    return isinstance(artist, Text) and "world" in artist.get_text()


def turned(history, start):
    """(steps, slews) degrees between what was believed and the truth, by SciPy."""
    true = np.concatenate([start.quaternion[None], history.quaternion[:-1]])
    believed, true = (Rotation.from_quat(np.reshape(x, (-1, 4))) for x in (history.believed, true))
    return np.rad2deg((believed.inv() * true).magnitude()).reshape(STEPS, -1)


def test_a_star_tracker_without_errors_is_believed_at_the_time_of_the_truth(drawn):
    """At each decision what is believed is the truth, which the curve of the truth shows then."""
    flown = flight(seeing())
    figures = drawn(flown)
    for name in paper.TABLE_5:
        shown = curves(figures[name].axes[1])
        true, believed, error = (shown[x] for x in ("true", "believed", "estimation error"))
        np.testing.assert_allclose(believed[1:], true[:-1], rtol=1e-5, atol=1e-4)
        np.testing.assert_allclose(believed[0], [0, 100], atol=0.01)
        assert np.abs(true[1:, 1] - true[:-1, 1]).max() > 1  # a step's delay could be seen
        np.testing.assert_allclose(error[:, 0], believed[:, 0])
        assert error[:, 1].max() < 1e-4


def test_the_curves_are_of_the_recorded_beliefs(drawn):
    flown = flight(seeing(**NOISY))
    figures, period = drawn(flown), flown.env.control_period
    times = np.arange(STEPS) * period
    start, history = paper.table_5_slews(), flown.table_5[1]
    expected = turned(history, start)
    assert 0.1 < np.median(expected) < 10
    for index, name in enumerate(paper.TABLE_5):
        shown = curves(figures[name].axes[1])
        np.testing.assert_allclose(shown["estimation error"][:, 0], times, rtol=1e-6)
        np.testing.assert_allclose(shown["estimation error"][:, 1], expected[:, index], atol=1e-4)
        angle = np.rad2deg(Rotation.from_quat(history.believed[:, index]).magnitude())
        np.testing.assert_allclose(shown["believed"][:, 1], angle, atol=1e-3)
    last = figures["final_seconds"].axes[0].lines[3:6]
    for index, line in enumerate(last):
        end = expected[-len(line.get_xdata()) :, index]
        np.testing.assert_allclose(line.get_ydata(), end, atol=1e-4)
        assert line.get_xdata()[-1] == pytest.approx(times[-1])
    start = flown.starts
    random = turned(flown.record(start)[1], start)
    shown = curves(figures["error_histories"].axes[0])["estimation error, 50%"]
    np.testing.assert_allclose(shown[:, 1], np.median(random, axis=1), atol=1e-4)
    np.testing.assert_allclose(shown[:, 0], times, rtol=1e-6)


@pytest.mark.parametrize("flown_in", [World(), PUSHING], ids=["ideal", "pushing"])
def test_where_the_truth_is_told_there_is_no_estimate_and_no_ideal_world_is_named(drawn, flown_in):
    flown, is_named = flight(flown_in), flown_in is PUSHING
    assert flown.belief(paper.table_5_slews(), flown.table_5[1]) is None
    for name, figure in drawn(flown).items():
        titles = [axis.get_title() for axis in figure.axes] + [figure.get_suptitle()]
        assert any(NAME in x for x in titles) == is_named, name
        assert not any(x.get_parse_math() for x in figure.findobj(is_title))
        assert not any("world" in x for x in titles) or is_named
        for axis in figure.axes:
            labels = {line.get_label() for line in axis.lines}
            assert not any("believed" in x or "estimat" in x for x in labels)
