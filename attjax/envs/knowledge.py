"""What those who fly in a world may know of it: how wrong things can be, not what they are.

All of it follows from the world's description: a flight loop has no numbers set by hand.
"""

import math
from typing import Any, NamedTuple

import chex
import jax.numpy as jnp
from flax import struct

from attjax.dynamics.clock import Clock
from attjax.dynamics.moving_parts import Motors, Wheels
from attjax.dynamics.vectors import Vector
from attjax.envs.doubt import Doubt, deviation_from_one, doubt
from attjax.envs.sensors import ALLAN_TOP, ARCSEC, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, PPM, clock_of
from attjax.envs.torque_bounds import delays
from attjax.envs.torque_noise import TorqueNoise, torque_noise
from attjax.spacecraft import INTEGRATION_STEP
from attjax.world import World
from attjax.world.distributions import moments, root_mean_square


class AttitudeNoise(struct.PyTreeNode):
    """Of a star tracker's samples.

    Attributes:
        across, about: standard deviations across the boresight and about it, rad.
        boresight: direction, body frame; known when it is compiled.
        clock: of the samples.
    """

    across: chex.Numeric
    about: chex.Numeric
    boresight: tuple[float, ...] = struct.field(pytree_node=False)
    clock: Clock = struct.field(pytree_node=False)


class RateNoise(struct.PyTreeNode):
    """Of a gyro's samples.

    Attributes:
        sample: standard deviation of a sample about each axis, rad/s.
        along, across: of its error's share in the rate about the axis, and about the others.
        bias: at an episode's start, rad/s; None: it has none, and all axes are right.
        walk: of what it changes by, rad/s in √s.
        limit: rad/s; a sample of it says nothing.
        clock: of the samples.
    """

    sample: chex.Numeric
    along: chex.Numeric
    across: chex.Numeric
    bias: chex.Numeric | None
    walk: chex.Numeric
    limit: float | None = struct.field(pytree_node=False)
    clock: Clock = struct.field(pytree_node=False)

    def share_of(self, change: Vector, rate: Vector) -> list[Any]:
        """Variance, about each axis, of what its bias seems to change by as the rate changes.

        Scale factors and misalignments are the same all the time: from rest to ω the variance grows
        to σ² ω², by σ² (2 ω dω + dω²) with each change.

        Args:
            change, rate: by components, rad/s.
        """
        grown = [abs(x) * (abs(x) + 2 * abs(w)) for x, w in zip(change, rate)]
        total = grown[0] + grown[1] + grown[2]
        along, across = self.along**2, self.across**2
        return [along * x + across * (total - x) for x in grown]


class KnownWheels(NamedTuple):
    """Reaction wheels as they are believed to be, and their motors."""

    wheels: Wheels
    motors: Motors


class Knowledge(struct.PyTreeNode):
    """What is known of a world; by default that of one where the truth is told at once.

    Attributes:
        attitude: None: the true attitude is told.
        rate: None: the true rate is told.
        torque: None: nothing disturbs.
        along, across: standard deviations of a torque, as shares of it.
        inertia: of a moment of inertia, as a share of it.
        wheels: None: it has none.
        doubt: of inertia and torque axes, effect by effect.
        delay: from a command to its torque, RK4 steps, on average; known when it is compiled.
        delays: least and most of it, where each episode has another; None: it is always the same,
            or another for each command.
        is_filtered: whether what is told is filtered even where it is the truth.
    """

    attitude: AttitudeNoise | None = None
    rate: RateNoise | None = None
    torque: TorqueNoise | None = None
    along: chex.Numeric = 0.0
    across: chex.Numeric = 0.0
    inertia: chex.Numeric = 0.0
    wheels: KnownWheels | None = None
    doubt: Doubt = Doubt()
    delay: int = struct.field(pytree_node=False, default=0)
    delays: tuple[int, int] | None = struct.field(pytree_node=False, default=None)
    is_filtered: bool = struct.field(pytree_node=False, default=False)

    @property
    def is_truth(self) -> bool:
        """Whether there is nothing to estimate: the truth is told, and torques come at once."""
        return self.is_told and self.delay == 0 and not self.is_filtered

    @property
    def is_told(self) -> bool:
        """Whether the sensors say the truth."""
        return self.attitude is None and self.rate is None


def knowledge(
    world: World, inertia: chex.Array, period: chex.Numeric, axes: chex.Array | None = None
) -> Knowledge:
    """What is known of a world.

    Where the truth is told and torques come at once, it is what can be wrong of the spacecraft.

    Args:
        world: its description.
        inertia: as believed, (3,) or (3, 3), kg m².
        period: time between two decisions, s.
        axes: (axes, 3) unit vectors of the torque axes, body frame, where they have wheels.

    Example:
        >>> from attjax.world import Actuators
        >>> late = World(actuators=Actuators(delay=6, gain=1.1))
        >>> known = knowledge(late, jnp.array([0.872, 0.115, 0.797]), 1 / 40)
        >>> known.delay, round(known.along, 6)
        (6, 0.1)
    """
    sensors = world.sensors
    tracker, gyro = (sensors.star_tracker, sensors.gyro) if sensors else (None, None)
    delay = _delay(world.actuators)
    torque, wrong = torque_noise(world, inertia, period), doubt(world)
    wheels = _wheels(world.wheels, axes)
    if tracker is None and gyro is None and delay == 0 and _delays(world.actuators) is None:
        return Knowledge(torque=torque, wheels=wheels, doubt=wrong)
    inertia_error = _inertia_error(world.uncertainty)
    along, across = _torque_errors(world.actuators)
    return Knowledge(
        attitude=None if tracker is None else _attitude_noise(tracker),
        rate=None if gyro is None else _rate_noise(gyro, period),
        torque=torque,
        along=math.hypot(along, inertia_error),
        across=across,
        inertia=inertia_error,
        wheels=wheels,
        doubt=wrong,
        delay=delay,
        delays=_delays(world.actuators),
    )


def _wheels(given, axes):
    if given is None:
        return None
    coulomb, viscous, band = (
        moments(x)[0] for x in (given.coulomb_friction, given.viscous_friction, given.dead_band)
    )
    wheels = Wheels(
        axes=tuple(map(tuple, axes)),
        inertia=jnp.asarray(moments(given.inertia)[0], axes.dtype),
        most_speed=given.most_speed,
        coulomb=coulomb or None,
        viscous=viscous or None,
    )
    ones = (jnp.ones((), axes.dtype),) * len(axes)
    return KnownWheels(wheels, Motors(ones, given.most_torque, band or None))


def _delay(actuators):
    if actuators is None:
        return 0
    return round(moments(actuators.delay)[0] + moments(actuators.delay_jitter)[0])


def _delays(actuators):
    if actuators is None or actuators.delay_jitter != 0:
        return None
    ends = delays(actuators)
    return None if ends[0] == ends[1] else ends


def _torque_errors(actuators):
    if actuators is None:
        return 0.0, 0.0
    angle = math.radians(root_mean_square(actuators.misalignment_deg))
    return deviation_from_one(actuators.gain), angle / 2**0.5


def _inertia_error(uncertainty):
    if uncertainty is None:
        return 0.0
    factors = uncertainty.inertia_factor, uncertainty.moment_factor
    turned = math.radians(root_mean_square(uncertainty.axes_turned_deg))
    return math.hypot(*map(deviation_from_one, factors), min(turned, 1))


def _attitude_noise(tracker):
    across, about = (
        ARCSEC * root_mean_square(x) for x in (tracker.cross_boresight_arcsec, tracker.roll_arcsec)
    )
    return AttitudeNoise(across, about, tracker.boresight, clock_of(tracker))


def _rate_noise(gyro, period):
    clock = clock_of(gyro)
    interval = clock.period * INTEGRATION_STEP if clock.period else period
    white = DEG_PER_ROOT_HOUR * root_mean_square(gyro.angle_random_walk_deg_per_root_h)
    fixed = DEG_PER_HOUR * root_mean_square(gyro.bias_deg_per_h) / 3**0.5
    wandering = DEG_PER_HOUR / ALLAN_TOP * root_mean_square(gyro.bias_instability_deg_per_h)
    along = PPM * root_mean_square(gyro.scale_factor_ppm)
    across = ARCSEC * root_mean_square(gyro.misalignment_arcsec) / 2**0.5
    has_bias = any(x > 0 for x in (fixed, wandering, along, across))
    return RateNoise(
        sample=jnp.sqrt(white**2 / interval + gyro.resolution**2 / 12),
        along=along,
        across=across,
        bias=math.hypot(fixed, wandering) if has_bias else None,
        walk=wandering * math.sqrt(2 / gyro.bias_correlation_time),
        limit=gyro.rate_limit,
        clock=clock,
    )
