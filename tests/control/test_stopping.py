"""What braking does at least: against plants that are braked, in all directions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50
from periods import after_period, drawn, peak_squared, unit, within

from attjax import AttitudeEnv
from attjax.control import stopping as stoppings
from attjax.control.plants import plants
from attjax.control.stopping import directions, stopping

ENV = AttitudeEnv(5)
LIMIT, PERIOD = 0.5, 1 / 40
OFF = {
    "exact": within(),
    "all": within(
        factors=(0.9, 1.1), turned=0.01, tilt=0.02, disturbance=0.001, rate=0.001,
        share=np.stack([np.full(19, 0.95), np.full(19, 1.05)]),
    ),
}  # fmt: skip


def braking(bounds):
    context = ENV.context(ENV.default_params)
    of_these = plants(context, bounds)
    return context, of_these, stopping(of_these, LIMIT, bounds.rate, PERIOD, bounds.duration)


@jax.jit
def most_lowering(of_these, error, told):
    """(n,) the braking action of (n, 3) rates."""
    told = told @ of_these.axes
    peaks = jnp.minimum(jax.vmap(of_these.peak, (0, None))(told, error), LIMIT)
    beside = jax.vmap(of_these.beside, (0, None))(peaks, error)
    return jnp.argmin(2 * jax.vmap(of_these.work)(told) + beside, axis=-1)


def braked(of_these, bounds, rng, inertia, rate):
    """Rates (n, 3) after a period in which each is braked as the assurance does it."""
    count = len(rate)
    action = most_lowering(of_these, bounds.rate, rate + bounds.rate * unit(rng, count))
    action = np.asarray(action)
    impulse = np.asarray(of_these.impulse, float)[action]
    given = drawn(rng, np.diag(LM50), bounds, (impulse, action), count)[1]
    pushed = bounds.disturbance * unit(rng, count)
    return after_period(inertia, rate, given, pushed, PERIOD, 1 / 240)


def bodies(bounds, rng, count):
    nothing = np.zeros((count, 3)), np.zeros(count, int)
    return drawn(rng, np.diag(LM50), bounds, nothing, count)[0]


@pytest.mark.parametrize("cells", [2, 7])
def test_no_direction_is_far_from_the_grid(cells):
    grid, anywhere = directions(cells), unit(np.random.default_rng(0), 20_000)
    corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T / 3**0.5
    for points in (anywhere, corners):
        apart = np.min(np.linalg.norm(points[:, None] - grid[None], axis=-1), axis=1)
        assert np.max(apart) <= 2**0.5 / cells
    assert np.linalg.norm(grid, axis=1) == pytest.approx(1)


@pytest.mark.parametrize("off", OFF)
def test_braking_lowers_by_at_least_what_is_said(x64, off):
    rng, bounds = np.random.default_rng(0), OFF[off]
    _, of_these, braking_of = braking(bounds)
    edges, decrease = map(np.asarray, (braking_of.edges, braking_of.decrease))
    count, least = 300, np.inf
    for high, low, said in zip(edges, edges[1:], decrease):
        if said == 0:
            continue
        inertia, rate = bodies(bounds, rng, count), unit(rng, count)
        at = rng.uniform(low, high, count)
        rate *= (at / np.sqrt(peak_squared(inertia, rate)))[:, None]
        after = braked(of_these, bounds, rng, inertia, rate)
        done = at - np.sqrt(peak_squared(inertia, after))
        assert np.all(done >= said)
        least = min(least, np.min(done) / said)
    assert least < (1.15 if off == "exact" else 4)


@pytest.mark.parametrize("off", OFF)
def test_nothing_turns_farther_than_to_its_stopping_angle(x64, off):
    rng, bounds = np.random.default_rng(1), OFF[off]
    _, of_these, braking_of = braking(bounds)
    count, periods = 60, 500
    inertia, rate = bodies(bounds, rng, count), unit(rng, count)
    start = rng.uniform(0.02, LIMIT, count)
    rate *= (start / np.sqrt(peak_squared(inertia, rate)))[:, None]
    turned, most = np.zeros(count), None
    bound = np.interp(start, braking_of.edges[::-1], braking_of.angles[::-1])
    for number in range(periods):
        peak = np.sqrt(peak_squared(inertia, rate))
        turned += PERIOD * peak
        left = bound + float(braking_of.rest) * PERIOD * (number + 1)
        assert np.all(turned <= left + 1e-9)
        rate = braked(of_these, bounds, rng, inertia, rate)
        if number > periods - 100:
            most = max(most or 0, np.max(np.sqrt(peak_squared(inertia, rate))))
    assert most <= braking_of.rest
    if off == "exact":
        assert np.max(turned / bound) > 0.6


def test_the_rate_of_an_angle_is_the_inverse(x64):
    _, _, braking_of = braking(OFF["exact"])
    for number in (0, 3, 10, 25):
        edge, angle = braking_of.edges[number], braking_of.angles[number]
        assert float(braking_of.peak(angle)) == pytest.approx(float(edge), rel=1e-9)
    between = float(braking_of.peak((braking_of.angles[2] + braking_of.angles[3]) / 2))
    assert between == pytest.approx(float(braking_of.edges[2] + braking_of.edges[3]) / 2)
    assert float(braking_of.peak(-0.1)) == 0
    assert float(braking_of.peak(100.0)) == pytest.approx(LIMIT)


def test_of_a_short_flight_braking_is_as_certain():
    """Though it is not worth while to brake far: in 10 ms nothing turns."""
    _, _, at_length = braking(OFF["exact"])
    _, _, at_once = braking(OFF["exact"]._replace(duration=0.01))
    assert at_once.is_certain and np.all(at_once.decrease == at_length.decrease)
    assert 0.05 * LIMIT < float(at_once.rest) < 0.2 * LIMIT and float(at_length.rest) < 0.001


def test_what_is_left_of_the_rate_is_little_where_braking_takes_long():
    """Of plants that are known badly, at the limit it takes more than the whole flight."""
    badly = within(factors=(0.7, 1.3), duration=15.0)
    _, _, braking_of = braking(badly)
    assert braking_of.is_certain and 15 * float(braking_of.rest) < 0.2


def test_torques_that_are_too_weak_brake_nothing():
    strong = within(disturbance=0.2)
    _, of_these, braking_of = braking(strong)
    assert not braking_of.is_certain and np.all(braking_of.decrease == 0)
    assert stoppings.coasting(of_these, LIMIT, 0.0) > 0
    dead = within(share=np.stack([np.where(np.arange(19) % 6 < 3, 0.0, 1.0), np.ones(19)]))
    assert not braking(dead)[2].is_certain
