"""Pictures: what is in them, and the tools that ask for them."""

import jax.numpy as jnp
import matplotlib
import numpy as np
import pytest

from attjax import AttitudeEnv
from attjax.dynamics import quaternion
from attjax.wrappers import rendering

PARAMS = AttitudeEnv().default_params
HALF = rendering.WIDTH // 2
REST = np.zeros((1, 3))
GOAL = np.array([[0.0, 0.0, 0.0, 1.0]])


def renderer(inertia=PARAMS.inertia, max_steps=100, num_envs=1):
    return rendering.Renderer(np.asarray(inertia), 0.5, 0.00436, 0.1, max_steps, num_envs)


def body(frame):
    """Where the spacecraft is painted: none of the greys of the rest of its half."""
    left = frame[:, :HALF].astype(int)
    return np.ptp(left, axis=-1) > 12


def blue(frame):
    """Pixels of the curves (upper, lower) in the right half."""
    red, green, blue = np.moveaxis(frame[:, HALF:].astype(int), -1, 0)
    found = (blue > red + 60) & (blue > green + 30)
    half = rendering.HEIGHT // 2
    return found[:half], found[half:]


def test_a_frame_shows_the_attitude_as_it_is():
    drawn = renderer()
    drawn.record(GOAL, REST, np.array([0]))
    at_goal = drawn.frame()
    assert at_goal.shape == (rendering.HEIGHT, rendering.WIDTH, 3) and at_goal.dtype == np.uint8
    assert 0.05 < body(at_goal).mean() < 0.5
    # LM50 is long along y: turned by 90° about the line of sight, it lies the other way
    turn = np.array(quaternion.from_axis_angle(jnp.array(rendering.VIEW[2]), jnp.pi / 2))
    for sign, lies_like in ((1, False), (-1, False), (0, True)):
        turned = turn if sign else GOAL[0]
        turned = turned * [sign, sign, sign, 1] if sign else turned
        drawn.record(turned[None], REST, np.array([0]))
        rows, columns = np.nonzero(body(drawn.frame()))
        slope = np.corrcoef(rows, columns)[0, 1]
        assert (slope > 0) == lies_like  # at the goal its +y end points right and down
    # a small turn about the line of sight moves the picture counterclockwise
    small = np.array(quaternion.from_axis_angle(jnp.array(rendering.VIEW[2]), 0.3))
    drawn.record(small[None], REST, np.array([0]))
    flat = np.nonzero(body(drawn.frame()))
    assert abs(np.corrcoef(*flat)[0, 1]) < abs(np.corrcoef(*np.nonzero(body(at_goal)))[0, 1])


def test_curves_grow_with_the_episode_and_begin_anew_with_the_next():
    drawn = renderer(num_envs=2)
    widths = []
    for step in range(40):
        time = np.array([step, step % 20])
        speed = np.full((2, 3), [0.01, 0.0, 0.0])
        drawn.record(np.tile([0.1, 0, 0, 1.0], (2, 1)), speed, time)
        if step in (10, 39):
            widths.append([[np.any(x, axis=0).sum() for x in blue(drawn.frame(i))] for i in (0, 1)])
    early, late = np.array(widths)
    assert np.all(early[0] == early[1]) and np.all(late[0] > 3 * early[0])
    assert np.all(late[1] < 0.6 * late[0])


def test_the_heights_of_the_curves_are_those_of_error_and_rate():
    drawn = renderer()
    heights = []
    for angle, rate in ((1.0, 1e-3), (0.01, 0.3)):
        turned = np.array(quaternion.from_axis_angle(jnp.array([1.0, 0, 0]), angle))
        for step in range(50):
            drawn.record(turned[None], np.array([[0.0, rate, 0.0]]), np.array([step]))
        heights.append([np.nonzero(x)[0].mean() for x in blue(drawn.frame())])
    (large_error, small_rate), (small_error, large_rate) = heights
    assert small_error > large_error + 20 and small_rate > large_rate + 20


@pytest.mark.parametrize(
    "inertia", [[1.0, 1, 1], [1.0, 0.5, 0.5], [[2, 0.3, 0], [0.3, 1, 0], [0, 0, 2]]]
)
def test_other_bodies_are_drawn_too(inertia):
    drawn = renderer(inertia)
    drawn.record(GOAL, REST, np.array([0]))
    assert 0.02 < body(drawn.frame()).mean() < 0.6


def test_the_box_has_the_bodys_inertia():
    a, b, c = rendering.box(PARAMS.inertia)
    moments = np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    np.testing.assert_allclose(moments / moments[0], np.array(PARAMS.inertia) / 0.872, rtol=0.02)


def test_matplotlib_is_left_as_it_was_and_its_settings_change_no_picture():
    def draw():
        drawn = renderer()
        drawn.record(GOAL, REST, np.array([0]))
        return drawn.frame()

    plain = draw()
    with matplotlib.rc_context({"lines.linewidth": 9, "font.size": 30, "axes.facecolor": "red"}):
        before = dict(matplotlib.rcParams)
        np.testing.assert_array_equal(draw(), plain)
        assert dict(matplotlib.rcParams) == before
