"""The sensors of a world's description, drawn for one episode."""

import math

import chex
import jax
import jax.numpy as jnp

from attjax.dynamics.clock import Clock
from attjax.dynamics.draws import Draws
from attjax.dynamics.noise import Noise
from attjax.dynamics.sensing import Seen, Sensing
from attjax.dynamics.sensors import Gyro, StarTracker
from attjax.spacecraft import INTEGRATION_STEP
from attjax.world import Sensors, telling

ARCSEC, PPM = math.radians(1 / 3600), 1e-6
DEG_PER_HOUR = math.radians(1) / 3600
DEG_PER_ROOT_HOUR = math.radians(1) / 60
"""In rad, 1, rad/s and rad/√s."""

ALLAN_TOP = 0.6174
"""Of a Gauss-Markov process: the top of its Allan deviation over its standard deviation."""


def drawn_sensing(
    sensors: Sensors | None, draws: Draws, state: Seen, period: chex.Numeric
) -> Sensing | None:
    """The sensors of an episode, at its start; None where the truth is told.

    Args:
        sensors: their description.
        draws: of the episode.
        state: attitude and rate at the start.
        period: time between two decisions, s.
    """
    if sensors is None or sensors == Sensors():
        return None
    given = sensors.star_tracker, sensors.gyro
    tracker = None if given[0] is None else _tracker(given[0], draws)
    gyro = None if given[1] is None else _gyro(given[1], draws, period)
    noise = Noise.of(jax.random.key_data(draws.key), -1)  # before any agent step
    return Sensing.begun((tracker, gyro), state, noise)


def clock_of(sensor: telling.Gyro | telling.StarTracker) -> Clock:
    """When a sensor samples, and when it tells that."""
    if sensor.rate_hz is None:
        return Clock()
    latency = getattr(sensor, "latency", 0.0)
    period = round(telling.RK4_STEPS_A_SECOND / sensor.rate_hz)
    return Clock(period, min(period, round(latency / INTEGRATION_STEP)))


def _tracker(tracker, draws):
    across, about = (
        ARCSEC * draws.number(f"star_tracker.{x}", getattr(tracker, x))
        for x in ("cross_boresight_arcsec", "roll_arcsec")
    )
    return StarTracker(across, about, tracker.boresight, tracker.most_rate, clock_of(tracker))


def _gyro(gyro, draws, period):
    """Its errors; what is exactly 0 is left out."""
    clock = clock_of(gyro)
    interval = clock.period * INTEGRATION_STEP if clock.period else period
    walk, bias, instability = (
        None if x == 0 else factor * draws.number(f"gyro.{name}", x)
        for name, x, factor in (
            ("walk", gyro.angle_random_walk_deg_per_root_h, DEG_PER_ROOT_HOUR),
            ("bias", gyro.bias_deg_per_h, DEG_PER_HOUR),
            ("instability", gyro.bias_instability_deg_per_h, DEG_PER_HOUR / ALLAN_TOP),
        )
    )
    wandered = None
    if instability is not None:
        wandered = instability * draws.normal("gyro.wandered", (3,))
    return Gyro(
        matrix=_matrix(gyro, draws),
        noise=None if walk is None else walk / jnp.sqrt(interval),
        bias=None if bias is None else bias * draws.direction("gyro.bias_axis"),
        wandering=instability,
        wandered=wandered,
        correlation_time=gyro.bias_correlation_time,
        rate_limit=gyro.rate_limit,
        resolution=gyro.resolution,
        clock=clock,
    )


def _matrix(gyro, draws):
    """A row for each of its three axes: its direction, times one and its scale factor's error."""
    if gyro.scale_factor_ppm == 0 and gyro.misalignment_arcsec == 0:
        return None
    scale = 1 + PPM * draws.number("gyro.scale_factor_ppm", gyro.scale_factor_ppm, (3,))
    angles = ARCSEC * draws.number("gyro.misalignment_arcsec", gyro.misalignment_arcsec, (3,))
    axes = [draws.tilted(f"gyro.axis.{n}", row, angles[n]) for n, row in enumerate(jnp.eye(3))]
    return scale[:, None] * jnp.stack(axes)
