"""Spacecraft of every kind, drawn at random: what a policy that flies any of them practises on.

What a slew is like depends on numbers without units alone: how many control periods it takes, how
far the rate limit lies below the rate that it could come to, how the moments of inertia and the
levels of torque compare. These are drawn; masses, torques and limits in SI units follow.
"""

from typing import NamedTuple

import chex
import jax.numpy as jnp
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


PUSHED = 0.1
"""Share of the spacecraft that are not crippled on which a constant torque acts."""

PUSH = 3e-4, 0.1
"""Its impulse in a control period, as a share of the largest impulse."""


PRINCIPAL = 0.8
"""Share of the crippled spacecraft whose principal axes are the body's."""


class Fleet(NamedTuple):
    """Spacecraft, as in :class:`attjax.EnvParams`, whose torque axes are the body's.

    Attributes:
        inertia: (count, 3, 3) tensors, kg m².
        torque_table: (count, 19, 3) torques of 1/240 s, N m, in the order of Table 1.
        rate_limit: (count,) rad/s.
        disturbance: (count, 3) torques that always act, body frame, N m; None: none do.
    """

    inertia: np.ndarray
    torque_table: np.ndarray
    rate_limit: np.ndarray
    disturbance: np.ndarray | None = None

    def parameters(self) -> dict[str, chex.Array]:
        """By the names of the parameters, in JAX's default floating-point type."""
        given = {name: x for name, x in self._asdict().items() if x is not None}
        return {name: jnp.asarray(x, float) for name, x in given.items()}


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


def with_faults(
    random: np.random.Generator, fleet: Fleet, frameskips: np.ndarray, crippled_share: float
) -> Fleet:
    """The fleet, some of it with one axis dead, some of the others under a constant torque.

    Args:
        random: that these are drawn by.
        fleet: of :func:`draw`.
        frameskips: (count,) of each.
        crippled_share: of the spacecraft, those with a dead axis.
    """
    count, period = len(frameskips), (np.asarray(frameskips) + 1) * INTEGRATION_STEP
    table, inertia = fleet.torque_table.copy(), fleet.inertia.copy()
    impulse = np.max(table, axis=(1, 2)) * INTEGRATION_STEP
    push = _pushes(random, count) * (impulse / period)[:, None]
    crippled, axis = random.random(count) < crippled_share, random.integers(0, 3, count)
    table[crippled, :, axis[crippled]] = 0
    push[crippled] = 0  # of which there would be none to hold it
    alone = crippled & (random.random(count) < PRINCIPAL)
    moments = random.permuted(np.linalg.eigvalsh(inertia[alone]), axis=1)
    inertia[alone] = moments[:, :, None] * np.eye(3)
    return fleet._replace(inertia=inertia, torque_table=table, disturbance=push)


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


def _pushes(random, count):
    """(count, 3) impulses of constant torques as shares of the largest that is commanded."""
    direction = random.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    sizes = _log_uniform(random, PUSH, (count, 1))
    return np.where(random.random((count, 1)) < PUSHED, sizes * direction, 0)


def _tables(levels):
    """(count, 19, 3) torque tables of (count, 3) levels about the body axes."""
    shares = np.array(Spacecraft(torque_levels=(1, 1, 1)).torque_table)
    rows = np.repeat(levels, 6, axis=1)
    return shares * np.concatenate([np.zeros((len(levels), 1)), rows], axis=1)[..., None]
