"""How strong a world's disturbances can be, and how fast they change, for who estimates them."""

import math

import chex
import jax.numpy as jnp
from flax import struct

from attjax.dynamics.disturbances import EARTH_DIPOLE, EARTH_MU, EARTH_RADIUS, SOLAR_PRESSURE
from attjax.envs.sensors import ARCSEC, clock_of
from attjax.spacecraft import INTEGRATION_STEP
from attjax.world import World
from attjax.world.distributions import moments, root_mean_square

LEAST_TORQUE = 1e-15
"""N m: gravity does not turn a sphere, and nothing is to be divided by that."""


class TorqueNoise(struct.PyTreeNode):
    """Of the disturbances together.

    Attributes:
        variance: about each axis, N² m².
        turning: of those that change as the body turns, or the orbit goes on, N² m².
        orbit_turns: how fast they change while the body is still, rad/s.
        swinging: what others change by, N² m² s⁻¹.
        hidden: the star tracker's noise, rad √s, over the acceleration by such a torque, rad/s².
    """

    variance: chex.Numeric
    turning: chex.Numeric
    orbit_turns: chex.Numeric
    swinging: chex.Numeric
    hidden: chex.Numeric

    def walk(self, speed: chex.Numeric) -> chex.Numeric:
        """What it changes by, N² m² s⁻¹, of a body that turns so fast, rad/s.

        It changes smoothly, by σ² (ω t)² in a time t < 1/ω. Taken for a walk that changes it by as
        much in the filter's memory τ, of three integrations a noise's density over the walk's to
        the power of 1/6, q = σ² ω² τ has τ = (ρ I/(σ ω))^(2/7). Twice that is taken.
        """
        rate = speed + self.orbit_turns
        turned = self.hidden ** (2 / 7) * rate ** (5 / 7)
        return 2 * self.turning * rate * jnp.minimum(1, turned) + self.swinging


def torque_noise(world: World, inertia: chex.Array, period: chex.Numeric) -> TorqueNoise | None:
    """What is known of a world's disturbances; None where there are none.

    Of directions that are uniform, a torque a × f has ²⁄₉ a² f² about each axis.

    Args:
        world: its description.
        inertia: as believed, (3,) or (3, 3), kg m².
        period: time between two decisions, s.
    """
    given = world.disturbances
    if given is None:
        return None
    fixed = moments(given.constant_torque)[1] / 3
    turning, orbital_rate = 0.0, 0.0
    if world.orbit is not None:
        radius = EARTH_RADIUS + 1e3 * moments(world.orbit.altitude_km)[0]
        orbital_rate = math.sqrt(EARTH_MU / radius) / radius
        field = EARTH_DIPOLE * (EARTH_RADIUS / radius) ** 3
        turning += 4 / 9 * moments(given.residual_dipole)[1] * field**2  # B² is 2 B₀² on average
        if given.drag is not None:
            speed = orbital_rate * radius
            turning += 2 / 9 * (speed**2 / 2) ** 2 * _mean_square(given.drag, "density")
        if given.gravity_gradient:
            turning = turning + _gravity_gradient(orbital_rate, inertia)
    if given.radiation_pressure is not None:
        turning = turning + 2 / 9 * SOLAR_PRESSURE**2 * _mean_square(given.radiation_pressure)
    swinging, swing = 0.0, 0.0
    if given.sinusoid is not None:
        swinging = moments(given.sinusoid.torque)[1] / 6
        swing = 2 * math.pi / moments(given.sinusoid.period)[0]
    total = fixed + turning + swinging
    if isinstance(total, float) and total == 0:
        return None
    return TorqueNoise(
        variance=total,
        turning=turning,
        orbit_turns=2 * orbital_rate,
        swinging=2 * swinging * swing,
        hidden=_hidden(world.sensors, inertia, jnp.sqrt(total), period),
    )


def _hidden(sensors, inertia, torque, period):
    tracker = None if sensors is None else sensors.star_tracker
    if tracker is None:
        return 0.0
    interval = clock_of(tracker).period * INTEGRATION_STEP or period
    density = ARCSEC * root_mean_square(tracker.cross_boresight_arcsec) * jnp.sqrt(interval)
    moment = jnp.mean(inertia if inertia.ndim == 1 else jnp.diag(inertia))
    return moment * density / jnp.maximum(torque, LEAST_TORQUE)


def _mean_square(part, *more):
    names = "area", "coefficient", "lever_arm", *more
    return math.prod(moments(getattr(part, name))[1] for name in names)


def _gravity_gradient(rate, inertia):
    """Mean square about an axis of 3 n² r̂ × I r̂ for uniform r̂: n⁴ (3 tr I² − (tr I)²)/5."""
    squared = jnp.sum(inertia**2)
    trace = jnp.sum(inertia) if inertia.ndim == 1 else jnp.trace(inertia)
    return rate**4 * (3 * squared - trace**2) / 5
