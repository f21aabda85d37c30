"""Controls and numbers of the page of eval.py --playback; skipped where there is no Chromium."""

import jax
import numpy as np
import pytest
from pages import CONTROLLERS, ENV, HOSTILE, embedded, find

from attjax import evaluation

webdriver = pytest.importorskip("selenium.webdriver")
from selenium.webdriver.common.keys import Keys  # noqa: E402
from selenium.webdriver.support.ui import Select, WebDriverWait  # noqa: E402


def numbers(browser, name):
    """One of the live numbers, in both panels."""
    return [x.text for x in browser.find_elements("css selector", f"dd.{name}")]


def time(browser):
    return browser.execute_script("return attjax.player.time")


def wait_until(browser, condition):
    return WebDriverWait(browser, 20).until(lambda _: condition())


def pictures(browser):
    script = "return [...document.querySelectorAll('.scene')].map((x) => x.toDataURL())"
    return browser.execute_script(script)


def angles_deg(slews_html):
    """(slews, controllers, steps + 1), in float64."""
    q = embedded(slews_html.read_text(encoding="utf-8"))["flights"][..., :4].astype(float)
    return np.rad2deg(2 * np.arctan2(np.linalg.norm(q[..., :3], axis=-1), q[..., 3]))


def shown(x):
    """A number as the page writes it: three digits."""
    if x >= 1e-3:
        return f"{x:#.3g}".rstrip(".")
    mantissa, exponent = f"{x:.2e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def test_playing_moves_time_and_picture_and_the_space_bar_stops(browser):
    before = pictures(browser)
    find(browser, "#play").click()
    wait_until(browser, lambda: time(browser) > 1)
    assert all(a != b for a, b in zip(before, pictures(browser)))
    assert find(browser, "#play").text == "Pause"
    find(browser, ".scene").send_keys(Keys.SPACE)
    stopped = time(browser)
    assert find(browser, "#play").text == "Play"
    browser.execute_async_script("setTimeout(arguments[0], 300)")
    assert time(browser) == stopped > 1
    assert find(browser, "#clock").text == f"{stopped // 0.0875 * 0.0875:.2f} / 43.75 s"
    find(browser, "body").send_keys(Keys.SPACE)
    wait_until(browser, lambda: time(browser) > stopped)
    find(browser, "#play").send_keys(Keys.SPACE)  # the button's own answer, not twice
    assert find(browser, "#play").text == "Play"


def test_speed_and_the_end(browser):
    Select(find(browser, "#speed")).select_by_visible_text("8×")
    find(browser, "#play").click()
    script = """
    const done = arguments[0], [time, now] = [attjax.player.time, performance.now()];
    setTimeout(() => done((attjax.player.time - time) / (performance.now() - now) * 1000), 2000);
    """
    assert 6 < browser.execute_async_script(script) < 9
    wait_until(browser, lambda: find(browser, "#play").text == "Play")
    assert time(browser) == 43.75 and find(browser, "#clock").text == "43.75 / 43.75 s"
    find(browser, "#play").click()  # again from the start
    assert 0 <= time(browser) < 40


def test_the_numbers_are_those_of_the_flight(browser, slews_html):
    angles = angles_deg(slews_html)
    data = embedded(slews_html.read_text(encoding="utf-8"))
    slews = Select(find(browser, "#slew"))
    assert [option.text for option in slews.options] == data["slews"]
    for slew, (name, of_slew) in enumerate(zip(data["slews"], angles)):
        slews.select_by_index(slew)
        assert time(browser) == 0
        assert numbers(browser, "angle") == [shown(x) for x in of_slew[:, 0]]
        assert numbers(browser, "settled") == ["–", "–"]
        assert numbers(browser, "impulse") == ["0.00", "0.00"]
        find(browser, "#time").send_keys(Keys.END)
        assert numbers(browser, "angle") == [shown(x) for x in of_slew[:, -1]]
        rate, torque = (
            np.linalg.norm(data["flights"][slew, ..., i : i + 3], axis=-1) for i in (4, 7)
        )
        assert numbers(browser, "rate") == [shown(x) for x in rate[:, -1]]
        impulse = torque.astype(float).sum(axis=-1) / 240
        np.testing.assert_allclose(np.array(numbers(browser, "impulse"), float), impulse, rtol=5e-3)
        last = [np.flatnonzero(x > 0.25)[-1] for x in of_slew]
        assert numbers(browser, "settled") == [f"{(k + 1) * 0.0875:.2f}" for k in last]
        label = find(browser, ".curves canvas").get_attribute("aria-label")
        assert name in label and shown(of_slew[0, -1]) in label


def test_settling_times_are_those_of_the_evaluation(browser):
    flown = evaluation.fly(
        CONTROLLERS["phase-plane"], ENV, ENV.default_params, jax.random.key(0), 4
    )
    times = evaluation.settling_times(flown, ENV)
    for index, expected in enumerate(times):
        Select(find(browser, "#slew")).select_by_index(3 + index)
        find(browser, "#time").send_keys(Keys.END)
        assert float(numbers(browser, "settled")[0]) == pytest.approx(expected, abs=0.1)


def test_a_click_or_a_drag_on_the_curves_scrubs(browser):
    actions = webdriver.ActionChains(browser)
    for curves in browser.find_elements("css selector", ".curves"):
        width = curves.size["width"] - 52 - 42  # the margins of curves.js
        for share in (0.5, 0.2):
            across = round(52 + share * width - curves.size["width"] / 2)
            actions.move_to_element_with_offset(curves, across, -60).click().perform()
            assert time(browser) == pytest.approx(43.75 * share, abs=0.2)
        actions.move_to_element_with_offset(curves, 0, 0).click_and_hold()
        actions.move_by_offset(round(width / 8), 20).release().perform()
        middle = (curves.size["width"] / 2 - 52) / width
        assert time(browser) == pytest.approx(43.75 * (middle + 1 / 8), abs=0.2)
    left = float(find(browser, ".future").value_of_css_property("left")[:-2])
    assert left == pytest.approx(52 + width * time(browser) / 43.75, abs=1)


def test_a_narrow_window_of_time_is_drawn_larger(browser):
    chart = "return document.querySelector('.curves canvas').toDataURL()"
    whole = browser.execute_script(chart)
    Select(find(browser, "#span")).select_by_visible_text("2 s")
    narrow = browser.execute_script(chart)
    find(browser, "#time").send_keys(Keys.END)
    assert len({whole, narrow, browser.execute_script(chart)}) == 3


def test_conditions_are_shown_and_a_hostile_name_is_only_text(browser):
    conditions = find(browser, "#conditions").get_attribute("textContent")
    for part in ("11.43 Hz (frameskip 20)", "seed 0", "diag(0.872, 0.115, 0.797)", HOSTILE):
        assert part in conditions
    assert browser.execute_script("return document.scripts.length") == 2


@pytest.mark.parametrize("width, height", [(1280, 800), (390, 844)])
def test_nothing_is_cut_off(browser, width, height):
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        script = """
        const root = document.documentElement;
        const outside = [...document.querySelectorAll("body *")].filter((x) => {
          const box = x.getBoundingClientRect();
          return box.left < 0 || box.right > innerWidth + 0.5;
        });
        return [root.scrollWidth, root.scrollHeight, outside.map((x) => x.outerHTML)];
        """
        wait_until(browser, lambda: browser.execute_script(script)[0] == width)  # once drawn anew
        wide, high, outside = browser.execute_script(script)
        assert wide == width and outside == []
        assert high == height or width < 500  # on a phone the panels lie one below the other
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
