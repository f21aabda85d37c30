"""The conditions that controllers are tried in, each at two strengths or more, and named worlds."""

import math

from attjax.spacecraft import INTEGRATION_STEP, Spacecraft
from attjax.world import (
    Actuators,
    Disturbances,
    Gyro,
    Sensors,
    StarTracker,
    Uncertainty,
    Uniform,
    World,
    names,
)


def conditions(spacecraft: Spacecraft, frameskip: int) -> dict[str, World]:
    """The worlds of the ladder, by their names.

    Torques are shares of the spacecraft's, delays whole control periods, and what is told is told
    at each decision.

    Args:
        spacecraft: that flies.
        frameskip: RK4 steps after the first in a control period.

    Example:
        >>> from attjax.spacecraft import LM50
        >>> list(conditions(LM50, 5))[:3]
        ['ideal', 'each moment ±20 %', 'each moment ±50 %']
    """
    steps, levels = frameskip + 1, spacecraft.torque_levels
    worlds = {"ideal": World()}
    worlds |= _inertia() | _torques(len(levels), max(levels)) | _sensors(steps * INTEGRATION_STEP)
    for periods, name in ((1, "one period"), (2, "two periods")):
        worlds[f"delay of {name}"] = World(actuators=Actuators(delay=periods * steps))
    for strength, name in ((1, "together"), (2, "together, twice")):
        worlds[f"noise, delay, inertia and torque {name}"] = _together(strength, steps, levels)
    return worlds | {name: World.named(name) for name in names()[1:]}


def _inertia():
    worlds = {}
    for percent in (20, 50):
        any_of = Uniform(1 - percent / 100, 1 + percent / 100)
        worlds[f"each moment ±{percent} %"] = World(uncertainty=Uncertainty(moment_factor=any_of))
    for angle in (5, 10):
        name = f"principal axes turned by {angle}°"
        worlds[name] = World(uncertainty=Uncertainty(axes_turned_deg=angle))
    for factor in (0.5, 0.8, 1.25, 2):
        worlds[f"inertia x {factor:g}"] = World(uncertainty=Uncertainty(inertia_factor=factor))
    return worlds


def _torques(count, largest):
    worlds = {}
    for angle in (5, 10):
        of_axis = Uniform(1 - angle / 100, 1 + angle / 100)
        actuators = Actuators(gain=of_axis, misalignment_deg=angle)
        worlds[f"torques turned by {angle}°, ±{angle} %"] = World(actuators=actuators)
    for share in (0.002, 0.01):
        torque = share * largest
        disturbances = Disturbances(constant_torque=torque)
        worlds[f"constant torque of {torque:.3g} N m"] = World(disturbances=disturbances)
    for dead in range(1, count):
        levels = tuple(range(count - dead + 1, count + 1))
        name = "smallest torques dead" if dead == 1 else f"{dead} smallest torques dead"
        worlds[name] = World(actuators=Actuators(dead_levels=levels))
    for gain, name in ((0.5, "one axis at half its torque"), (0.0, "one axis dead")):
        worlds[name] = World(actuators=Actuators(faulty_axes=(1,), fault_gain=gain))
    return worlds


def _told(arcsec, rate, period):
    """Sensors that tell attitude and rate with white noise of so much a sample."""
    walk = math.degrees(rate * math.sqrt(period)) * 60
    return Sensors(
        star_tracker=StarTracker(cross_boresight_arcsec=arcsec, roll_arcsec=arcsec),
        gyro=Gyro(angle_random_walk_deg_per_root_h=walk),
    )


def _sensors(period):
    worlds = {}
    for arcsec, rate in ((5, 1e-4), (30, 5e-4)):
        name = f'noise of {arcsec}" and {rate:g} rad/s'
        worlds[name] = World(sensors=_told(arcsec, rate, period))
    for rate in (1e-4, 1e-3):
        bias = math.degrees(rate) * 3600
        worlds[f"rate bias of {rate:g} rad/s"] = World(
            sensors=Sensors(gyro=Gyro(bias_deg_per_h=bias))
        )
    return worlds


def _together(strength, steps, levels):
    """As design studies have them: all at once, each at a moderate strength, or at twice that."""
    spread = 0.1 * strength
    return World(
        sensors=_told(5 * strength, 1e-4 * strength, steps * INTEGRATION_STEP),
        actuators=Actuators(delay=strength * steps),
        uncertainty=Uncertainty(moment_factor=Uniform(1 - spread, 1 + spread)),
        disturbances=Disturbances(constant_torque=2e-5 * strength * max(levels)),
    )
