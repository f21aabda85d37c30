"""Spacecraft drawn at random are spacecraft, and of the kinds that they are said to be."""

import functools

import numpy as np
import pytest
from scipy import stats

from attjax import AttitudeEnv, Spacecraft
from attjax.envs import fleet
from attjax.spacecraft import INTEGRATION_STEP

COUNT = 4000
FRAMESKIPS = np.resize([5, 7, 10, 14, 20], COUNT)


@functools.cache
def drawn():
    return fleet.draw(np.random.default_rng(3), FRAMESKIPS)


def test_each_can_be_described():
    spacecraft = drawn()
    for inertia, table, limit in list(zip(*spacecraft[:3]))[:300]:
        levels = np.linalg.norm(table[1::6], axis=1)
        described = Spacecraft(
            inertia=inertia.tolist(), torque_levels=levels.tolist(), rate_limit=float(limit)
        )
        np.testing.assert_allclose(described.torque_table, table, atol=1e-15)


def test_moments_are_over_two_decades_and_turned_freely():
    moments, axes = np.linalg.eigh(drawn().inertia)
    assert moments.min() < 0.06 and 4 < moments.max() <= 5 and moments.min() >= 0.05 * (1 - 1e-9)
    assert np.all(moments[:, 2] <= (moments[:, 0] + moments[:, 1]) * (1 + 1e-9))
    off = np.abs(drawn().inertia[:, 0, 1]) > 0
    assert np.mean(off) == pytest.approx(fleet.TURNED, abs=0.02)
    # The largest moment's axis is uniform on the sphere: each cosine is uniform.
    for cosine in np.abs(axes[off, :, 2]).T:
        assert stats.kstest(cosine, "uniform").pvalue > 1e-4


def test_slews_levels_and_limits_are_as_said():
    spacecraft = drawn()
    period = (FRAMESKIPS + 1) * INTEGRATION_STEP
    levels = np.linalg.norm(spacecraft.torque_table[:, 1::6], axis=2)
    moments = np.linalg.eigvalsh(spacecraft.inertia)
    average = levels[:, 0] * INTEGRATION_STEP / period
    duration = 2 * np.sqrt(np.pi / 2 * moments.mean(axis=1) / average)
    periods = duration / period
    low, high = fleet.QUARTER_TURN
    assert low * (1 - 1e-9) <= periods.min() < 1.05 * low and periods.max() <= high * (1 + 1e-9)
    assert duration.max() == pytest.approx(fleet.LONGEST)
    kick = levels[:, 0] * INTEGRATION_STEP / moments[:, 0]
    shares = levels / levels[:, :1]
    finest = shares[:, 2] * kick * period
    assert finest.max() == pytest.approx(fleet.COARSEST)
    free = finest < fleet.COARSEST * (1 - 1e-9)
    assert 0.7 < np.mean(free) < 0.95
    assert np.all(np.diff(shares, axis=1) <= 0)
    assert shares[free].min() > 1 / (1.001 * fleet.STEPS**2)
    usual = np.isclose(shares[:, 1], 0.1) & (np.isclose(shares[:, 2], 0.01) | ~free)
    assert np.mean(usual) == pytest.approx(fleet.USUAL, abs=0.03)
    few = np.isclose(shares[:, 1], 1)
    assert np.mean(few) == pytest.approx(fleet.FEW, abs=0.02)
    assert np.mean(np.isclose(shares[:, 2], 1)) < 0.75 * fleet.FEW / 2
    assert np.all(spacecraft.rate_limit >= fleet.KICKS * kick * (1 - 1e-9))
    assert np.all(spacecraft.rate_limit >= fleet.SLOWEST)
    share = spacecraft.rate_limit * duration / np.pi
    assert np.percentile(share, 5) < 0.5 and np.percentile(share, 95) > 2


def test_turns_are_rotations():
    turns = fleet.turns(np.random.default_rng(0), 50)
    np.testing.assert_allclose(
        turns @ turns.swapaxes(1, 2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1)


def test_the_same_random_numbers_draw_the_same_spacecraft():
    again = fleet.draw(np.random.default_rng(3), FRAMESKIPS)
    other = fleet.draw(np.random.default_rng(4), FRAMESKIPS)
    for x, y, z in zip(drawn()[:3], again[:3], other[:3]):
        np.testing.assert_array_equal(x, y)
        assert not np.allclose(x, z)


def test_faults_are_as_said():
    """Dead axes of bodies that have products of inertia and of some that have none; torques."""
    sound = drawn()
    faulty = fleet.with_faults(np.random.default_rng(5), sound, FRAMESKIPS, 0.3)
    np.testing.assert_array_equal(faulty.rate_limit, sound.rate_limit)
    dead = np.all(faulty.torque_table == 0, axis=1)
    crippled = np.any(dead, axis=1)
    assert np.all(np.sum(dead, axis=1)[crippled] == 1)
    assert np.mean(crippled) == pytest.approx(0.3, abs=0.02)
    assert np.all(np.mean(dead[crippled], axis=0) > 0.28)  # each axis
    np.testing.assert_array_equal(faulty.torque_table[~crippled], sound.torque_table[~crippled])
    np.testing.assert_array_equal(faulty.inertia[~crippled], sound.inertia[~crippled])
    np.testing.assert_allclose(
        np.linalg.eigvalsh(faulty.inertia[crippled]), np.linalg.eigvalsh(sound.inertia[crippled])
    )
    off = np.any(faulty.inertia[crippled][:, *np.triu_indices(3, 1)] != 0, axis=1)
    assert np.mean(off) == pytest.approx((1 - fleet.PRINCIPAL) * fleet.TURNED, abs=0.05)
    sizes = np.linalg.norm(faulty.disturbance, axis=1)
    assert np.all(sizes[crippled] == 0)
    pushed = sizes[~crippled] > 0
    assert np.mean(pushed) == pytest.approx(fleet.PUSHED, abs=0.03)
    period = (FRAMESKIPS + 1) * INTEGRATION_STEP
    largest = np.max(sound.torque_table, axis=(1, 2)) * INTEGRATION_STEP
    share = (sizes * period / largest)[~crippled][pushed]
    low, high = fleet.PUSH
    assert low <= share.min() < 2 * low and 0.5 * high < share.max() <= high


def test_parameters_are_named_as_those_of_an_environment():
    sound = drawn()
    assert set(sound.parameters()) == {"inertia", "torque_table", "rate_limit"}
    faulty = fleet.with_faults(np.random.default_rng(5), sound, FRAMESKIPS, 0.3).parameters()
    assert set(faulty) == {"inertia", "torque_table", "rate_limit", "disturbance"}
    assert AttitudeEnv(20).default_params.replace(**faulty).disturbance.shape == (COUNT, 3)
