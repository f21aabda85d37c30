"""How wrong inertia and torque axes can be, effect by effect, for who identifies them in flight."""

import math

import chex
from flax import struct

from attjax.world import World
from attjax.world.distributions import Number, moments, root_mean_square


class Doubt(struct.PyTreeNode):
    """Standard deviations; by default nothing is wrong.

    Attributes:
        inertia: of all moments together, as a share of what they are.
        moments: of each by itself.
        turned: of the principal axes about each axis, rad.
        gain: of each torque axis's torque, as a share.
        tilt: of its direction about each axis across it, rad.
    """

    inertia: chex.Numeric = 0.0
    moments: chex.Numeric = 0.0
    turned: chex.Numeric = 0.0
    gain: chex.Numeric = 0.0
    tilt: chex.Numeric = 0.0


def doubt(world: World) -> Doubt:
    """What a world's description says of it.

    Example:
        >>> from attjax.world import Uncertainty
        >>> doubt(World(uncertainty=Uncertainty(inertia_factor=2.0))).inertia
        0.5
    """
    shape, torque = world.uncertainty, world.actuators
    found: dict[str, float] = {}
    if shape is not None:
        found |= {
            "inertia": _of_inverse(shape.inertia_factor),
            "moments": _of_inverse(shape.moment_factor),
            "turned": math.radians(root_mean_square(shape.axes_turned_deg)) / 3**0.5,
        }
    if torque is not None:
        found |= {
            "gain": deviation_from_one(torque.gain),
            "tilt": math.radians(root_mean_square(torque.misalignment_deg)) / 2**0.5,
        }
    return Doubt(**found)


def deviation_from_one(factor: Number) -> float:
    """Root of the mean square of a factor's difference from 1."""
    mean, square = moments(factor)
    return math.sqrt(max(square - 2 * mean + 1, 0))


def _of_inverse(factor):
    """Of 1/f from 1, (f − 1)/f, with the mean of f for the divisor: what moves is the inverse."""
    return deviation_from_one(factor) / moments(factor)[0]
