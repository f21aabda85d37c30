"""What bounds all plants of a belief, against plants that are drawn and sought within it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, rotated_inertia
from periods import WHEELS, after_period, drawn, ends, peak_squared, unit, within

from attjax import AttitudeEnv, Spacecraft
from attjax.control.plants import plants

SKEW = Spacecraft(torque_axes=((1, 0.2, 0), (0, 1, -0.3), (0.4, 0, 1)))
HELD = Spacecraft(
    inertia=((0.9, 0.02, 0.01), (0.02, 0.5, -0.03), (0.01, -0.03, 0.8)),
    torque_levels=(0.05, 0.01, 0.002),
    torque_held=True,
)
CRAFT = {
    "pulses": Spacecraft(),
    "tensor": Spacecraft(inertia=rotated_inertia().tolist()),
    "skew axes": SKEW,
    "held": HELD,
}
OFF = {
    "exact": {},
    "moments": {"factors": (0.8, 1.2)},
    "axes": {"turned": 0.1},
    "torques": {"share": np.stack([np.full(19, 0.8), np.full(19, 1.1)]), "tilt": 0.1},
    "offset": {"offset": np.full(19, 2e-4)},
    "disturbed": {"disturbance": 0.005},
    "rate": {"rate": 0.01},
    "all": {
        "factors": (0.9, 1.1), "turned": 0.05, "tilt": 0.03, "disturbance": 0.002, "rate": 0.005,
        "share": np.stack([np.full(19, 0.9), np.full(19, 1.1)]), "offset": np.full(19, 1e-5),
    },
}  # fmt: skip
COUNT = 1500


def believed(craft):
    env = AttitudeEnv(5, spacecraft=CRAFT[craft])
    context = env.context(env.default_params)
    inertia = np.asarray(context.inertia, float)
    return context, np.diag(inertia) if inertia.ndim == 1 else inertia


def changes(craft, off, rng, count=COUNT, wheels=None):
    """Of drawn plants: P² before, what it changes by, and the bounds of both."""
    context, tensor = believed(craft)
    bounds = within(**OFF[off], wheels=wheels)
    action = rng.integers(0, 19, count)
    table, duration = np.asarray(context.torque_table, float), float(context.torque_duration)
    impulse = table[action] * duration
    inertia, given = drawn(rng, tensor, bounds, (impulse, action), count)
    rate = unit(rng, count) * ends(rng, 0, 0.5, (count, 1)) ** 2 * 2
    disturbance = bounds.disturbance * unit(rng, count)
    momentum = None if wheels is None else wheels.momentum * unit(rng, count)
    period = float(context.control_period)
    after = after_period(inertia, rate, given, disturbance, period, duration, momentum)
    norm = peak_squared if wheels is None else lambda _, w: np.sum(w**2, axis=-1)
    before, change = norm(inertia, rate), norm(inertia, after) - norm(inertia, rate)
    told = rate + bounds.rate * unit(rng, count)
    of_these = plants(context, bounds)
    principal = jnp.asarray(told) @ of_these.axes
    peaks = jax.vmap(of_these.peak, (0, None))(principal, bounds.rate)
    work = jax.vmap(of_these.work)(principal)[np.arange(count), action]
    beside = jax.vmap(of_these.beside, (0, None))(np.sqrt(before), bounds.rate)
    return before, change, peaks**2, 2 * work + beside[np.arange(count), action]


@pytest.mark.parametrize("craft", CRAFT)
@pytest.mark.parametrize("off", OFF)
def test_no_plant_within_the_bounds_changes_more(x64, craft, off):
    rng = np.random.default_rng(0)
    before, change, peak, bound = changes(craft, off, rng)
    assert np.all(before <= peak * (1 + 1e-9) + 1e-15)
    assert np.all(change <= bound + 1e-12)
    # And it is no bound of anything: of many plants the worst comes near.
    large = np.abs(bound) > np.quantile(np.abs(bound), 0.9)
    slack = np.min(bound[large] - change[large]) / np.median(np.abs(bound[large]))
    assert slack < (0.05 if off == "exact" else 0.5)


@pytest.mark.parametrize("off", ["exact", "moments", "all"])
def test_no_plant_with_wheels_changes_more(x64, off):
    rng = np.random.default_rng(1)
    before, change, peak, bound = changes("held", off, rng, wheels=WHEELS)
    assert np.all(before <= peak * (1 + 1e-9))
    assert np.all(change <= bound + 1e-12)


def test_without_torque_nothing_grows(x64):
    """Whatever the inertia is: coasting leaves each one's own P as it is, to the last bit."""
    context, _ = believed("pulses")
    of_these = plants(context, within(**(OFF["moments"] | OFF["axes"] | OFF["torques"])))
    rate = jnp.array([0.1, 0.2, -0.3])
    change = 2 * of_these.work(rate) + of_these.beside(of_these.peak(rate, 0.1), 0.1)
    assert change[0] == 0 and np.all(change[1:] != 0)


def test_coefficients_are_reached(x64):
    """For moments within bounds: nothing passes them, and most of them are attained."""
    rng = np.random.default_rng(2)
    context, _ = believed("pulses")
    for factors in ((0.9, 1.1), (0.7, 1.3), (0.5, 1.5)):
        found = plants(context, within(factors=factors)).coefficients
        moments = LM50 * ends(rng, *factors, (100_000, 3))
        keeps = 2 * np.max(moments, axis=1) <= np.sum(moments, axis=1)
        moments = moments[keeps]
        low, high = (f(moments, axis=1)[:, None] for f in (np.min, np.max))
        form = ((low + high) * moments - moments**2) / (low * high)
        work = form / moments
        assert np.all(form <= np.asarray(found.form) * (1 + 1e-12))
        assert np.all(work <= np.asarray(found.most_work) * (1 + 1e-12))
        assert np.all(work >= np.asarray(found.least_work) * (1 - 1e-12))
        assert np.all(work / moments <= np.asarray(found.growth) * (1 + 1e-12))
        np.testing.assert_allclose(np.max(form, axis=0), found.form, rtol=0.12)
        np.testing.assert_allclose(np.max(work, axis=0), found.most_work, rtol=0.25)
        np.testing.assert_allclose(np.min(work, axis=0), found.least_work, rtol=0.12)


@pytest.mark.parametrize("craft", ["pulses", "tensor", "skew axes"])
def test_the_worst_plant_that_is_sought_stays_within(x64, craft):
    """Hill climbing over plant, disturbance and error: nothing found passes the bound."""
    rng = np.random.default_rng(3)
    context, tensor = believed(craft)
    bounds = within(**OFF["all"])
    of_these, count = plants(context, bounds), 200
    action = rng.integers(1, 19, count)
    table, duration = np.asarray(context.torque_table, float), float(context.torque_duration)
    impulse = table[action] * duration
    told = unit(rng, count) * rng.uniform(0.05, 0.5, (count, 1))
    principal = jnp.asarray(told) @ of_these.axes
    work = np.asarray(jax.vmap(of_these.work)(principal))[np.arange(count), action]
    best, sought = np.full(count, -np.inf), None
    for trial in range(150):
        seed = np.random.default_rng(trial)
        inertia, given = drawn(seed, tensor, bounds, (impulse, action), count)
        fresh = [inertia, given, unit(seed, count), unit(seed, count)]
        if sought is not None:  # most of the numbers stay those of the worst so far
            kept = seed.uniform(size=(4, count)) < 0.6
            fresh = [
                np.where(k.reshape(-1, *[1] * (x.ndim - 1)), y, x)
                for k, x, y in zip(kept, fresh, sought)
            ]
        inertia, given, _, error = fresh
        rate = told + bounds.rate * error
        pushed, period = bounds.disturbance * fresh[2], float(context.control_period)
        after = after_period(inertia, rate, given, pushed, period, duration)
        before = peak_squared(inertia, rate)
        beside = jax.vmap(of_these.beside, (0, None))(np.sqrt(before), bounds.rate)
        bound = 2 * work + np.asarray(beside)[np.arange(count), action]
        excess = peak_squared(inertia, after) - before - bound
        assert np.all(excess <= 1e-12)
        if sought is None:
            sought = fresh
        is_worse = excess > best
        best = np.where(is_worse, excess, best)
        sought = [
            np.where(is_worse.reshape(-1, *[1] * (x.ndim - 1)), x, y) for x, y in zip(fresh, sought)
        ]
    assert np.max(best / np.abs(work)) > -0.6
