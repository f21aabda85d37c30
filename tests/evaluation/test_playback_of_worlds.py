"""The page of eval.py --playback where the truth is not told; what is painted, in Chromium."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pages import CONTROLLERS, ENV, embedded, find
from scipy.spatial.transform import Rotation
from worlds import world

from attjax import AttitudeEnv, evaluation
from attjax.evaluation import plots
from attjax.evaluation.playback import page as playback

STEPS = 60
NAME = "poor </script> tracker"
NOISY = {"cross_boresight_arcsec": 20000, "roll_arcsec": 40000}
ACTUATORS = {"misalignment_deg": 2.0, "gain": 0.9}


def of_world(tracker, **more):
    env = AttitudeEnv(20, world=world(name=NAME, sensors={"star_tracker": tracker}, **more))
    return env, env.default_params.replace(max_steps_in_episode=jnp.array(STEPS, jnp.int32))


@pytest.fixture(scope="module")
def html():
    return playback.page(CONTROLLERS, *of_world(NOISY, actuators=ACTUATORS), 3)


@pytest.fixture(scope="module")
def data(html):
    return embedded(html)


@pytest.fixture
def opened(chromium, html, tmp_path):
    """The page freshly loaded; no test may leave an error on the console."""
    path = tmp_path / "slews.html"
    path.write_text(html, encoding="utf-8")
    chromium.get(path.as_uri())
    yield chromium
    assert chromium.get_log("browser") == []


def errors_deg(data):
    """(slews, controllers, steps + 1) degrees between belief and truth, by SciPy."""
    believed, true = (
        Rotation.from_quat(x.reshape(-1, 4).astype(float))
        for x in (data["beliefs"], data["flights"][..., :4])
    )
    return np.rad2deg((believed.inv() * true).magnitude()).reshape(data["beliefs"].shape[:-1])


def test_beliefs_are_the_recorded_ones_of_the_evaluated_slews(data):
    """Those of Table 5 are the figures' too, in the same worlds; a row a sample, both ends too."""
    env, params = of_world(NOISY, actuators=ACTUATORS)
    key = jax.random.key(3)
    random = evaluation.random_slews(env, params, key, playback.RANDOM_SLEWS)[1]
    for n, controller in enumerate(CONTROLLERS.values()):
        table_5 = plots.Flight(controller, env, params, 3, 1).table_5[1]
        others = evaluation.record(controller, env, params, key, random, STEPS)
        for slews, history in ((slice(3), table_5), (slice(3, None), others)):
            believed = data["beliefs"][slews, n].swapaxes(0, 1)
            flown = data["flights"][slews, n].swapaxes(0, 1)
            np.testing.assert_allclose(believed[:STEPS], history.believed, atol=1e-5)
            np.testing.assert_allclose(flown[1:, :, :4], history.quaternion, atol=1e-5)
            np.testing.assert_allclose(flown[:-1, :, 7:], history.torque, atol=1e-6)
            assert not flown[-1, :, 7:].any()
    assert 1 < np.median(errors_deg(data)) < 30 and errors_deg(data)[..., -1].max() < 60


def test_a_star_tracker_without_errors_is_believed_at_every_sample():
    data = embedded(playback.page(CONTROLLERS, *of_world({}), 3))
    np.testing.assert_allclose(data["beliefs"], data["flights"][..., :4], atol=1e-6)


def test_there_is_a_world_and_there_are_beliefs_only_where_they_differ(data):
    short = ENV.default_params.replace(max_steps_in_episode=jnp.array(4, jnp.int32))
    ideal = embedded(playback.page(CONTROLLERS, ENV, short, 0))
    assert set(data) - set(ideal) == {"world", "beliefs", "leastTorque"}
    assert data["world"] == NAME and data["leastTorque"] == np.float32(0.005)
    told = AttitudeEnv(20, world=world(name=NAME, disturbances={"constant_torque": 1e-4}))
    pushed = embedded(playback.page(CONTROLLERS, told, short, 0))
    assert set(pushed) - set(ideal) == {"world", "leastTorque"}


def test_curves_and_numbers_are_those_of_the_beliefs(opened, data):
    expected = errors_deg(data)
    script = """
    return attjax.flights.map((slew) => slew.map((x) => [x.estimationError, x.believedAngle]));
    """
    found = np.rad2deg(np.array(opened.execute_script(script)))
    np.testing.assert_allclose(found[:, :, 0], expected, atol=1e-4)
    angles = np.rad2deg(
        Rotation.from_quat(data["beliefs"].reshape(-1, 4)).magnitude().reshape(expected.shape)
    )
    np.testing.assert_allclose(found[:, :, 1], angles, atol=1e-3)
    seek = "const x = document.getElementById('time'); x.value = arguments[0];"
    for step in (0, 17, STEPS):
        opened.execute_script(f"{seek} x.dispatchEvent(new Event('input'))", step)
        shown = [float(x.text) for x in opened.find_elements("css selector", "dd.estimate")]
        np.testing.assert_allclose(shown, expected[0, :, step], rtol=6e-3)
    assert f"world {NAME}" in find(opened, "#conditions").text
    assert "of the estimate" in find(opened, ".curves canvas").get_attribute("aria-label")


def test_the_ideal_page_shows_nothing_of_it(browser):
    assert not any(x.is_displayed() for x in browser.find_elements("css selector", "dd.estimate"))
    assert "world" not in find(browser, "#conditions").text
    assert browser.execute_script("return attjax.flights[0][0].believed === undefined")


@pytest.mark.parametrize("width, height", [(1280, 800), (1000, 800), (390, 844)])
def test_one_more_number_cuts_nothing_off(opened, width, height):
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    opened.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        script = """
        return [...document.querySelectorAll("dt, dd, h2")].filter((x) => {
          const [box, panel] = [x, x.closest(".panel")].map((y) => y.getBoundingClientRect());
          return x.scrollWidth > Math.ceil(box.width) || box.right > panel.right;
        }).map((x) => x.outerHTML);
        """
        assert opened.execute_script(script) == []
    finally:
        opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_rings_are_painted_where_the_axes_are_believed_to_be(opened):
    """Seen along −x, a belief of +50° about x has rings to the right and up, and around the eye."""
    half = np.deg2rad(50) / 2
    script = """
    Object.assign(attjax.camera, {azimuth: 0, elevation: 0});
    attjax.flights[0][0].quaternion = () => [0, 0, 0, 1];
    attjax.flights[0][0].believed = () => arguments[0];
    const painted = [];
    const arc = CanvasRenderingContext2D.prototype.arc;
    CanvasRenderingContext2D.prototype.arc = function (x, y) {
      painted.push([x - this.canvas.clientWidth / 2, 0.56 * this.canvas.clientHeight - y]);
    };
    document.getElementById("time").dispatchEvent(new Event("input"));
    CanvasRenderingContext2D.prototype.arc = arc;
    return painted.slice(0, 3);
    """
    x, y, z = opened.execute_script(script, [np.sin(half), 0, 0, np.cos(half)])
    assert np.hypot(*x) < 1
    for (across, up), degrees in ((y, 50), (z, 140)):
        assert np.rad2deg(np.arctan2(up, across)) == pytest.approx(degrees, abs=0.5)
