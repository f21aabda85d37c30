"""The 3-D view of eval.py --playback: camera and attitude; skipped where there is no Chromium."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pages import find
from scipy.spatial.transform import Rotation

from attjax import EnvState, step
from attjax.dynamics import quaternion as quaternions

webdriver = pytest.importorskip("selenium.webdriver")
from selenium.webdriver.common.keys import Keys  # noqa: E402


def test_drag_wheel_and_keys_move_the_camera(browser):
    def camera():
        return browser.execute_script("return {...attjax.camera}")

    scene, start = find(browser, ".scene"), camera()
    actions = webdriver.ActionChains(browser)
    actions.drag_and_drop_by_offset(scene, 60, 30).perform()
    turned = camera()
    assert turned["azimuth"] < start["azimuth"] and turned["elevation"] > start["elevation"]
    browser.execute_script(
        "document.querySelector('.scene').dispatchEvent(new WheelEvent('wheel', {deltaY: -200}))"
    )
    assert camera()["zoom"] > turned["zoom"]
    scene.send_keys(Keys.ARROW_LEFT, "-")
    assert camera()["azimuth"] < turned["azimuth"]


def test_two_fingers_zoom_and_one_turns(browser):
    def touch(kind, *across):
        points = [{"x": middle + x, "y": box["y"] + 100, "id": i} for i, x in enumerate(across)]
        touches = {"type": kind, "touchPoints": points}
        browser.execute_cdp_cmd("Input.dispatchTouchEvent", touches)

    def camera():
        return browser.execute_script("return {...attjax.camera}")

    box, start = find(browser, ".scene").rect, camera()
    middle = box["x"] + box["width"] / 2
    touch("touchStart", -20, 20)
    touch("touchMove", -40, 40)
    touch("touchEnd")
    zoomed = camera()
    assert zoomed["zoom"] == pytest.approx(2 * start["zoom"])
    assert zoomed["azimuth"] == start["azimuth"]
    touch("touchStart", 0)
    touch("touchMove", 30)
    touch("touchEnd")
    assert camera() == zoomed | {"azimuth": pytest.approx(start["azimuth"] - 0.3)}


def rotations(browser, q):
    """Rotation matrices as the page computes them."""
    script = "return arguments[0].map(attjax.rotation)"
    return np.array(browser.execute_script(script, np.asarray(q, float).tolist()))


def test_the_drawn_attitude_is_that_of_eq_9(browser):
    """Columns are the body's axes in the goal's frame, and turn by R [ω]× under body rates ω."""
    random = np.random.default_rng(0)
    q, rate = Rotation.random(50, random).as_quat(), random.normal(size=(50, 3))
    np.testing.assert_allclose(rotations(browser, q), Rotation.from_quat(q).as_matrix(), atol=1e-12)
    dt = 1e-6
    change = np.array([quaternions.derivative(a, w) for a, w in zip(q, rate)])
    after, before = (rotations(browser, q + sign * dt * change) for sign in (1, -1))
    turning = np.cross(rate[:, None], np.eye(3)).swapaxes(1, 2)  # columns: ω × each axis
    np.testing.assert_allclose(
        (after - before) / (2 * dt), rotations(browser, q) @ turning, atol=1e-6
    )


def test_a_positive_torque_about_x_turns_y_towards_z(browser):
    state = EnvState(jnp.array([0.0, 0, 0, 1]), jnp.zeros(3), 0)
    fly = jax.jit(step)
    for _ in range(30):
        state = fly(state, 1)  # +0.5 N m about x
    (matrix,) = rotations(browser, [state.quaternion])
    x, y, z = matrix.T
    np.testing.assert_allclose(x, [1, 0, 0], atol=1e-6)
    assert y[2] > 0.01 and z[1] < -0.01


def test_the_axes_are_painted_where_the_attitude_puts_them(browser):
    """Seen along −x, the goal's y points right and z up; +50° about x lifts the body's y."""
    half = np.deg2rad(50) / 2
    script = """
    Object.assign(attjax.camera, {azimuth: 0, elevation: 0});
    attjax.flights[0][0].quaternion = () => arguments[0];
    document.getElementById("time").dispatchEvent(new Event("input"));
    const canvas = document.querySelector(".scene"), {width, height} = canvas;
    const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
    const style = getComputedStyle(document.documentElement);
    return ["--y", "--z"].map((name) => {
      const hex = style.getPropertyValue(name).trim();
      const colour = [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
      const found = [];
      for (let i = 0; i < pixels.length; i += 4) {
        if (colour.every((value, k) => pixels[i + k] === value) && pixels[i + 3] === 255)
          found.push([(i / 4) % width - width / 2, 0.56 * height - Math.floor(i / 4 / width)]);
      }
      return found;
    });
    """
    found = browser.execute_script(script, [np.sin(half), 0, 0, np.cos(half)])
    for pixels, degrees in zip(found, (50, 140)):
        assert len(pixels) > 20
        across, up = np.mean(pixels, axis=0)
        assert np.rad2deg(np.arctan2(up, across)) == pytest.approx(degrees, abs=8)
