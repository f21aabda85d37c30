"""The most and the least of what a world's description leaves open; of its torques together."""

import math
from typing import Any

from attjax.dynamics.disturbances import EARTH_DIPOLE, EARTH_MU, EARTH_RADIUS, SOLAR_PRESSURE
from attjax.world import Actuators, Uncertainty, Wheels, World
from attjax.world.distributions import Number, largest, least

DEVIATIONS = 5
"""Of what is normally distributed without an end: so many standard deviations."""


def low(number: Number) -> float:
    """The least that it can be.

    Example:
        >>> from attjax.world import Normal, Uniform
        >>> low(Uniform(0.9, 1.1)), low(Normal(1.0, 0.1))
        (0.9, 0.5)
    """
    return _end(number, least(number), -DEVIATIONS)


def high(number: Number) -> float:
    """The most that it can be."""
    return _end(number, largest(number), DEVIATIONS)


def _end(number: Any, end: float, deviations: float) -> float:
    return end if math.isfinite(end) else number.mean + deviations * number.deviation


def most(number: Number) -> float:
    """The largest magnitude that it can have."""
    return max(abs(low(number)), abs(high(number)))


def delays(actuators: Actuators | None) -> tuple[int, int]:
    """The least and the most that a torque can come after its command, RK4 steps."""
    if actuators is None:
        return 0, 0
    numbers = actuators.delay, actuators.delay_jitter
    first, last = (round(sum(end(x) for x in numbers)) for end in (low, high))
    return first, last


def inertia_bounds(uncertainty: Uncertainty | None) -> tuple[tuple[float, float], float]:
    """Factors of the principal moments, and how far their axes can be turned, rad.

    A change in mid-flight is of all moments alike, which leaves the peak rate as it is.

    Example:
        >>> inertia_bounds(Uncertainty(inertia_factor=0.9, change_factor=2.0, change_time=5.0))
        ((0.9, 1.8), 0.0)
    """
    if uncertainty is None:
        return (1.0, 1.0), 0.0
    given = uncertainty.inertia_factor, uncertainty.moment_factor
    change, turned = uncertainty.change_factor, min(high(uncertainty.axes_turned_deg), 180)
    least = math.prod(map(low, given)) * min(1, low(change))
    largest = math.prod(map(high, given)) * max(1, high(change))
    return (least, largest), math.radians(turned)


def largest_disturbance(world: World, moments: Any) -> float:
    """The sum of the largest torques of all that nobody commands, N m.

    Args:
        world: its description.
        moments: the largest principal moments, rising, kg m².

    Example:
        >>> from attjax.world import Disturbances
        >>> largest_disturbance(World(disturbances=Disturbances(constant_torque=0.5)), [1, 1, 1])
        0.5
    """
    given, total = world.disturbances, 0.0
    if given is None:
        return total
    total += most(given.constant_torque)
    if given.sinusoid is not None:
        total += most(given.sinusoid.torque)
    if given.radiation_pressure is not None:
        total += SOLAR_PRESSURE * _product(given.radiation_pressure)
    if world.orbit is None:
        return total
    radius = EARTH_RADIUS + 1e3 * low(world.orbit.altitude_km)
    squared = EARTH_MU / radius**3
    if given.gravity_gradient:  # 3 n² r̂ × I r̂, whose product is at most half the largest moment
        total += 1.5 * squared * moments[2]
    if given.drag is not None:
        total += squared * radius**2 / 2 * _product(given.drag, "density")
    field = 2 * EARTH_DIPOLE * (EARTH_RADIUS / radius) ** 3  # above a pole
    return total + field * most(given.residual_dipole)


def _product(part, *more):
    names = "area", "coefficient", "lever_arm", *more
    return math.prod(most(getattr(part, name)) for name in names)


def largest_speed(world: World) -> float:
    """Of a reaction wheel, as far as the world limits it, rad/s."""
    limit = world.wheels.most_speed if world.wheels else None
    return math.inf if limit is None else limit


def friction(wheels: Wheels) -> float:
    """The most of each reaction wheel, N m."""
    viscous, speed = most(wheels.viscous_friction), wheels.most_speed
    moving = viscous * (math.inf if speed is None else speed) if viscous else 0.0
    return most(wheels.coulomb_friction) + moving
