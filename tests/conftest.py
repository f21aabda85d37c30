# ruff: noqa: E402
from pathlib import Path

import array_checks

array_checks.install()  # before attjax is imported, here or by what follows

import jax
import jaxtyping
import pages
import pytest
from commands import STEPS_PER_UPDATE, TINY, run
from fuzzing import Accepted

from attjax.commands import training_output
from attjax.evaluation import summary
from attjax.evaluation.playback import page as playback
from attjax.runs import trainer

jax.config.update("jax_num_cpu_devices", 2)  # what is shared out over devices is tested on two
jax.config.update("jax_legacy_prng_key", "error")  # typed keys throughout


MOST_MAPS = 20_000
"""Memory maps of a process: a training program takes 1,300; beyond Linux's 65,530 XLA crashes."""


@pytest.fixture(scope="module", autouse=True)
def few_memory_maps():
    """Forget the compiled programs of earlier modules before there are too many."""
    yield
    maps = Path("/proc/self/maps")
    if maps.exists() and maps.read_bytes().count(b"\n") > MOST_MAPS:
        jax.clear_caches()


@pytest.fixture
def x64():
    """Run a test in float64."""
    with jax.enable_x64(True):
        yield


@pytest.fixture
def as_users_run():
    """Signatures are not checked, so that what attjax itself says of bad input can be heard."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture
def strict_promotion():
    """Arrays of different types must not be combined (optax itself does, so not for all)."""
    with jax.numpy_dtype_promotion("strict"):
        yield


@pytest.fixture(scope="session")
def trained(tmp_path_factory):
    """A short run, and what train.py printed."""
    folder = tmp_path_factory.mktemp("runs") / "ckpt"
    result = run("train.py", *TINY, "--total-steps", 60 * STEPS_PER_UPDATE, "--checkpoint", folder)
    assert result.returncode == 0, result.stderr
    return folder, result.stdout


@pytest.fixture
def no_work(monkeypatch):
    """Input that is accepted raises Accepted, where the work would begin."""

    def accept(*_, **__):
        raise Accepted

    monkeypatch.setattr(summary, "fly", accept)
    monkeypatch.setattr(trainer, "_train", accept)
    monkeypatch.setattr(training_output.Terminal, "started", lambda *_: None)


@pytest.fixture(scope="session")
def chromium(tmp_path_factory):
    with pages.chromium(tmp_path_factory.mktemp("chromium")) as driver:
        yield driver


@pytest.fixture(scope="session")
def slews_html(tmp_path_factory):
    """A page of eval.py --playback."""
    path = tmp_path_factory.mktemp("page") / "slews.html"
    env = pages.ENV
    page = playback.page(pages.CONTROLLERS, env, env.default_params, 0, pages.HOSTILE)
    path.write_text(page, encoding="utf-8")
    return path


@pytest.fixture
def browser(chromium, slews_html):
    """The page freshly loaded; no test may leave an error on the console."""
    chromium.get(slews_html.as_uri())
    yield chromium
    assert chromium.get_log("browser") == []
