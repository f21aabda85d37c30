"""The page of eval.py --playback, and a browser that opens it."""

import base64
import json
import re
import shutil

import jax
import numpy as np
import pytest

from attjax import AttitudeEnv
from attjax.control import classical

ENV = AttitudeEnv(frameskip=20)
HOSTILE = "</script><script>alert(1)</script><!--\"'&$style"
CONTROLLERS = {
    "phase-plane": jax.tree_util.Partial(classical.phase_plane),
    "feedback": jax.tree_util.Partial(classical.quaternion_feedback),
}
FLAGS = (
    "headless", "no-sandbox", "disable-gpu", "disable-quic", "no-first-run",
    "disable-background-networking", "disable-component-update", "disable-sync",
    "window-size=1280,900",
)  # fmt: skip


def embedded(page):
    """The data of a page: flights as (slews, controllers, steps + 1, 10), beliefs as (..., 4)."""
    data = json.loads(re.search(r'id="flights">(.*?)</script>', page)[1])
    for name, size in (("flights", 10), ("beliefs", 4)):
        if name in data:
            flights = [[np.frombuffer(base64.b64decode(x), "<f4") for x in s] for s in data[name]]
            data[name] = np.array(flights).reshape(len(flights), -1, data["steps"] + 1, size)
    return data


def chromium(profile):
    """Chromium without a window; skips the test where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver")
    program = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if not (program and driver):
        pytest.skip("no Chromium with its chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for flag in (*FLAGS, f"user-data-dir={profile}"):
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(options, webdriver.ChromeService(driver))


def find(browser, selector):
    return browser.find_element("css selector", selector)
