"""How fast the plants of a belief can be braked for certain, and how far they turn meanwhile.

In each period the action is taken whose bound of the change of P² is least
(:class:`attjax.control.plants.Plants`). What that is at least, in whichever direction the body
turns, is found on a grid of directions, less what lies between its points at most.
"""

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax.control.plants import Plants
from attjax.dynamics.numerics import square_root

CELLS = 48
"""Along each edge of the cube whose surface makes the directions."""

PHASES, RATIO = 28, 0.7
"""Ranges of P from the limit down, each so much of the one before."""

TENTH = 6
"""Of the phases, that which begins at about a tenth of the limit."""


class Stopping(struct.PyTreeNode):
    """What braking does at least, from the limit down.

    Attributes:
        edges: (phases + 1,) P between the phases, falling, rad/s.
        angles: (phases + 1,) ∫P dt from there until it is at rest, at most, rad. Below the rate of
            rest it is a period's.
        decrease: (phases,) of P in a period, at least, rad/s; 0 where none is certain.
        rest: P once it is braked so far that more would turn it farther in a flight, and ever
            after, rad/s.
    """

    edges: chex.Array
    angles: chex.Array
    decrease: chex.Array
    rest: chex.Array

    @property
    def is_certain(self) -> chex.Array:
        """Whether braking is, at the limit."""
        return self.decrease[0] > 0

    def peak(self, angle: chex.Numeric) -> chex.Array:
        """A P that is at rest within that angle, rad/s; 0 where there is none.

        Between two edges the angle is convex in P, and at most what it is on the straight line.
        """
        edges, angles = (jnp.append(x, 0) for x in (self.edges, self.angles))
        share = (angle - angles[1:]) / (angles[:-1] - angles[1:])
        return jnp.sum(jnp.clip(share, 0, 1) * (edges[:-1] - edges[1:]))


def directions(cells: int) -> np.ndarray:
    """(6 cells², 3) unit vectors, no direction farther from one than √2/cells.

    They are the middles of the cells on the surface of a cube; the ball lies within it, and to be
    moved to the nearest of its points brings no two points farther apart.

    Example:
        >>> directions(1).tolist()[:2]
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    middles = (2 * np.arange(cells) + 1) / cells - 1
    first, second = (x.ravel() for x in np.meshgrid(middles, middles))
    faces = [
        np.roll(np.stack([np.full(cells**2, side), first, second], axis=1), axis, axis=1)
        for side in (1.0, -1.0)
        for axis in range(3)
    ]
    points = np.concatenate(faces)
    return points / np.linalg.norm(points, axis=1, keepdims=True)


@jax.jit
def stopping(
    plants: Plants,
    limit: chex.Numeric,
    error: chex.Numeric,
    period: chex.Numeric,
    duration: chex.Numeric,
) -> Stopping:
    """What braking does to the plants of a belief.

    Args:
        plants: all of them.
        limit: of P, rad/s.
        error: of the rate that is told, rad/s.
        period: s.
        duration: of a flight, s.
    """
    dtype = plants.form.dtype
    grid = jnp.asarray(directions(CELLS), dtype) / jnp.sqrt(plants.form)
    lowering = -jax.vmap(plants.work)(grid) - 2**0.5 / CELLS * _steepest(plants)
    edges = jnp.asarray(limit * RATIO ** np.arange(PHASES + 1), dtype)

    def decrease(high, low):
        share = 1 - plants.of_error(error) / low
        # Of P it is a sum of powers from P⁻¹ up, so that one of the ends has the most. The action
        # is chosen by a bound of P, not by P.
        taken = [plants.excess * p + 2 * plants.of_error(error) for p in (low, high)]
        besides = (plants.beside(x, error) / (2 * p) for x, p in zip(taken, (low, high)))
        beside = jnp.maximum(*besides)
        certain = jnp.where((lowering > 0) & (share > 0), share * lowering - beside, -jnp.inf)
        return jnp.min(jnp.max(certain, axis=-1))

    decreases = jax.lax.cummin(jax.vmap(decrease)(edges[:-1], edges[1:]))
    grown = jax.vmap(lambda edge: coasting(plants, edge, error))(edges)
    rests = square_root(edges**2 + grown)
    # P that falls by at least δ(P) in each period sums up, sampled at its beginnings, to at most
    # the first of it and ∫ P dP/δ.
    in_phases = (edges[:-1] ** 2 - edges[1:] ** 2) / 2 / jnp.maximum(decreases, 1e-30)
    # What is left of the rate turns the body all through a flight, however slow it was before: it
    # is braked down to where, from a tenth of the limit, it turns least in all.
    slow = jnp.where(jnp.arange(PHASES) < TENTH, 0, in_phases)
    last = jnp.argmin(period * jnp.append(0, jnp.cumsum(slow)) + duration * rests)
    counted = jnp.where(jnp.arange(PHASES) < last, in_phases, 0)
    angles = period * (edges + jnp.append(jnp.cumsum(counted[::-1])[::-1], 0))
    return Stopping(edges, angles, jnp.maximum(decreases, 0), rests[last])


def coasting(plants: Plants, peak: chex.Numeric, error: chex.Numeric) -> chex.Array:
    """The most that P² grows in a period without a command, (rad/s)².

    Args:
        plants: all of them.
        peak: P at its beginning, rad/s.
        error: of the rate that is told, rad/s.
    """
    working = jnp.max(plants.coefficients.most_work) + plants.turned * plants.inverse
    grown = 2 * plants.error * working * (peak + error) + plants.beside(peak, error)
    is_coasting = jnp.all(plants.impulse == 0, axis=-1)
    return jnp.min(jnp.where(is_coasting, grown, jnp.inf))


def _steepest(plants):
    """(actions,) how much the work changes at most with a direction in the norm of the form."""
    of, root = plants.coefficients, jnp.sqrt(plants.form)
    impulse = plants.impulse
    own, straight, worked = (
        jnp.sqrt(jnp.sum(x**2, axis=-1))
        for x in (impulse, of.most_work * impulse / root, of.most_work * impulse)
    )
    working = jnp.max(of.most_work / root) + plants.turned * plants.inverse
    tilted = straight + (plants.turned + plants.tilt) * own * working + plants.turned * worked
    return plants.share[1] * tilted + plants.error * working
