"""Spacecraft of every kind, drawn at random: what a policy that flies any of them practises on.

What a slew is like depends on numbers without units alone: how many control periods it takes, how
far the rate limit lies below the rate that it could come to, how the moments of inertia and the
levels of torque compare. These are drawn; masses, torques and limits in SI units follow.
"""

from typing import NamedTuple

import numpy as np

from attjax.dynamics import vectors
from attjax.spacecraft import INTEGRATION_STEP, Spacecraft

MOMENTS = 0.05, 5.0
"""Of principal moments of inertia, kg m²: two decades."""

TURNED = 0.85
"""Share of the spacecraft whose principal axes are not the body's."""

QUARTER_TURN = 40, 800
"""Control periods that a rest-to-rest turn of 90° about a mean moment would take at least."""

LONGEST = 15.0
"""The same in seconds, at most; 150° about the worst axis may still take longer than 43.75 s."""

LIMIT = 0.25, 4.0
"""Rate limit, as a share of the peak rate of that turn."""

SLOWEST = 0.09
"""Rate limit at least, rad/s."""

KICKS = 10
"""Largest impulses about the least moment that come to the rate limit, at least."""

STEPS = 20.0
"""Most that a level of torque may be of the next: two decades and a half in two steps."""

USUAL, FEW = 0.3, 0.1
"""Shares of spacecraft with the paper's levels, and of those with fewer than three different."""

COARSEST = np.deg2rad(0.025)
"""Turn in a control period, at most, by the smallest impulse about the least moment, rad: a tenth
of the paper's goal, which else could not be held.
"""


class Fleet(NamedTuple):
    """Spacecraft, as in :class:`attjax.EnvParams`, whose torque axes are the body's.

    Attributes:
        inertia: (count, 3, 3) tensors, kg m².
        torque_table: (count, 19, 3) torques of 1/240 s, N m, in the order of Table 1.
        rate_limit: (count,) rad/s.
    """

    inertia: np.ndarray
    torque_table: np.ndarray
    rate_limit: np.ndarray


def draw(random: np.random.Generator, frameskips: np.ndarray) -> Fleet:
    """Spacecraft for control rates of 240/(frameskip + 1) Hz.

    Args:
        random: that they are drawn by.
        frameskips: (count,) of each.

    Example:
        >>> fleet = draw(np.random.default_rng(0), np.full(100, 5))
        >>> fleet.inertia.shape, fleet.torque_table.shape, fleet.rate_limit.shape
        ((100, 3, 3), (100, 19, 3), (100,))
    """
    count, period = len(frameskips), (np.asarray(frameskips) + 1) * INTEGRATION_STEP
    moments = principal_moments(random, count)
    duration = np.minimum(_log_uniform(random, QUARTER_TURN, count) * period, LONGEST)
    # T = 2 √(θ I/U) with the torque U averaged over a period, J = U h: as time_optimal_reference.
    impulse = 4 * (np.pi / 2) * np.mean(moments, axis=1) * period / duration**2
    share = _log_uniform(random, LIMIT, count)
    kick = impulse / np.min(moments, axis=1)
    limit = np.maximum.reduce([share * np.pi / duration, KICKS * kick, np.full(count, SLOWEST)])
    shares = _level_shares(random, count)
    shares[:, -1] = np.minimum(shares[:, -1], COARSEST / (kick * period))
    levels = impulse[:, None] / INTEGRATION_STEP * shares
    return Fleet(_tensors(random, moments), _tables(levels), limit)


def principal_moments(random: np.random.Generator, count: int) -> np.ndarray:
    """(count, 3) principal moments, each log-uniform over MOMENTS, of bodies that there can be."""
    found = np.empty((0, 3))
    while len(found) < count:
        drawn = _log_uniform(random, MOMENTS, (4 * count, 3))
        can_be = np.max(drawn, axis=1) <= 0.5 * np.sum(drawn, axis=1)
        found = np.concatenate([found, drawn[can_be]])
    return found[:count]


def turns(random: np.random.Generator, count: int) -> np.ndarray:
    """(count, 3, 3) rotation matrices, uniformly distributed."""
    normal = random.normal(size=(count, 4, 1))
    unit = np.moveaxis(normal / np.linalg.norm(normal, axis=1, keepdims=True), 1, 0)[..., 0]
    return np.array(vectors.attitude_matrix(tuple(unit))).T


def _log_uniform(random, bounds, shape):
    return np.exp(random.uniform(*np.log(bounds), shape))


def _tensors(random, moments):
    axes = turns(random, len(moments))
    axes[random.random(len(moments)) >= TURNED] = np.eye(3)
    return np.einsum("nij,nj,nkj->nik", axes, moments, axes)


def _level_shares(random, count):
    """(count, 3) levels of torque as shares of the largest, descending."""
    steps = _log_uniform(random, (1, STEPS), (count, 2))
    kind = random.random(count)
    steps[kind < USUAL] = 10
    steps[kind > 1 - FEW, 0] = 1
    steps[kind > 1 - FEW / 2, 1] = 1
    return 1 / np.cumprod(np.column_stack([np.ones(count), steps]), axis=1)


def _tables(levels):
    """(count, 19, 3) torque tables of (count, 3) levels about the body axes."""
    shares = np.array(Spacecraft(torque_levels=(1, 1, 1)).torque_table)
    rows = np.repeat(levels, 6, axis=1)
    return shares * np.concatenate([np.zeros((len(levels), 1)), rows], axis=1)[..., None]
