"""No sequence of allowed actions passes the rate limit; tests/helpers/adversary.py tries more."""

import itertools

import adversary
import jax.numpy as jnp
import numpy as np
import pytest

from attjax.dynamics import rigid_body


@pytest.mark.parametrize("kind, form", list(zip(adversary.KINDS, itertools.cycle(adversary.FORMS))))
def test_no_adversary_passes_the_middle_between_margin_and_limit(kind, form):
    peaks, allowed = adversary.highest_peaks(kind, form, "highest", count=48, steps=100)
    assert peaks.max() <= (1 + adversary.MARGIN) / 2
    assert peaks.max() > 0.9 and allowed.mean() > 0.3  # it is not by forbidding everything


def test_gyroscopic_acceleration_is_bounded_in_the_norm_of_the_peak_rate():
    """The bound that the mask rests on, over all shapes of bodies and directions of the rate."""
    rng = np.random.default_rng(0)
    largest = 0.0
    for least in np.geomspace(1e-3, 1, 30):
        for middle in np.linspace(max(least, 1 - least), 1, 10):
            inertia = np.array([least, middle, 1.0])
            form = np.diag(rigid_body.peak_rate_form(jnp.asarray(inertia)))
            w = rng.normal(size=(2000, 3))
            w[0] = [form[1] ** 0.5, 0, form[1] ** 0.5]  # the worst of flat bodies
            w /= np.sqrt(np.sum(form * w**2, axis=1, keepdims=True))
            turning = np.cross(w, inertia * w) / inertia
            assert np.all(form >= 1 - 1e-4) and np.all(form <= 2 + 1e-4)
            largest = max(largest, np.sqrt(np.sum(form * turning**2, axis=1)).max())
    assert 0.99 * rigid_body.MOST_TURNING < largest <= rigid_body.MOST_TURNING * (1 + 1e-4)
