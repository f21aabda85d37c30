"""How far the plant can be from what is believed of it, so far as its world's description says."""

import itertools
import math
from typing import NamedTuple

import numpy as np

from attjax.envs.context import Context
from attjax.envs.delay_bounds import check_order, late, uncounted
from attjax.envs.sensors import ARCSEC, PPM
from attjax.envs.torque_bounds import (
    DEVIATIONS,
    friction,
    high,
    inertia_bounds,
    largest_disturbance,
    largest_speed,
    low,
    most,
)
from attjax.spacecraft import INTEGRATION_STEP, Spacecraft
from attjax.world import World


class WheelBounds(NamedTuple):
    """Of three reaction wheels.

    Attributes:
        axes: (3, 3) unit vectors, one a row, as believed, body frame.
        tilt: the largest angle of one from that, rad.
        length: of the sum of three vectors along them of length 1, at most.
        share: the most that their inertia is of the body's least moment without them.
        stored: the least momentum that a wheel has at its speed's limit, N m s; inf: no limit.
        momentum: the most that body and wheels can have together, N m s.
    """

    axes: np.ndarray
    tilt: float
    length: float
    share: float
    stored: float
    momentum: float


class Bounds(NamedTuple):
    """Of everything that the assurance holds for.

    Attributes:
        factors: least and largest of each principal moment's share of what is believed.
        turned: the largest angle of the principal axes from those believed, rad.
        share: (2, actions) least and largest that an action's impulse can be of what is believed.
        tilt: the largest angle of its direction from that believed, rad.
        offset: (actions,) N m s, the most that it can be off beside that.
        disturbance: the largest torque that nobody commands, N m.
        late: RK4 steps that a torque can come earlier or later than is believed.
        uncounted: torques at most of which it can be wrong whether they have come when another one
            begins; of held ones, the share of one.
        rate: the largest error of the rate that is told or estimated, rad/s.
        attitude: the same of the attitude, rad.
        waits: s between two samples of the rate, and from what the star tracker sees to when the
            next is told; 0 where they are told at each decision.
        duration: s, of a flight.
        wheels: None where torques come from outside.
    """

    factors: tuple[float, float]
    turned: float
    share: np.ndarray
    tilt: float
    offset: np.ndarray
    disturbance: float
    late: float
    uncounted: float
    rate: float
    attitude: float
    waits: tuple[float, float]
    duration: float
    wheels: WheelBounds | None = None


def bounds(world: World, spacecraft: Spacecraft, context: Context) -> Bounds:
    """The bounds that a world's description states.

    Args:
        world: that it flies in.
        spacecraft: as believed.
        context: of its controllers, with values.

    Raises:
        ValueError: the world has something that has no bound here.

    Example:
        >>> from attjax import AttitudeEnv
        >>> from attjax.world import Uncertainty, Uniform
        >>> lighter = World(uncertainty=Uncertainty(moment_factor=Uniform(0.9, 1.1)))
        >>> env = AttitudeEnv(frameskip=5, world=lighter)
        >>> bounds(lighter, env.spacecraft, env.context(env.default_params)).factors
        (0.9, 1.1)
    """
    _check_covered(world, context)
    (factors, turned), wheels = inertia_bounds(world.uncertainty), None
    moments = np.linalg.eigvalsh(_tensor(spacecraft))
    torque = largest_disturbance(world, factors[1] * moments)
    if world.wheels is not None:
        wheels = _wheels(world, spacecraft, moments[0] * factors[0], torque)
        torque = (1 + wheels.share) * (torque + wheels.length * friction(world.wheels))
    share, offset = _impulses(world, spacecraft, context, wheels)
    return Bounds(
        factors=factors,
        turned=turned,
        share=share,
        tilt=_tilt(world),
        offset=offset,
        disturbance=torque,
        late=late(world, context),
        uncounted=uncounted(world, context),
        rate=_rate_error(world, context, spacecraft),
        attitude=_attitude_error(context),
        waits=_waits(context),
        duration=spacecraft.duration,
        wheels=wheels,
    )


def _check_covered(world, context):
    if context.continuous:
        raise ValueError("assurance is over a finite set of actions, and these are continuous")
    if world.flexible is not None:
        raise ValueError("assurance does not know of disturbances.flexible, which the world has")
    if world.own_parts:
        raise ValueError(f"assurance knows of no bound of the world's {world.own_parts[0]}")
    changes = world.uncertainty is not None and world.uncertainty.change_factor != 1
    if changes and world.wheels is not None:  # of what docks, the momentum has no bound here
        raise ValueError("assurance knows of no bound of change_factor beside reaction wheels")
    limit = context.knowledge.rate and context.knowledge.rate.limit
    if limit is not None and limit <= float(context.rate_limit):
        raise ValueError(
            f"assurance needs a gyro that sees the rate limit, {float(context.rate_limit):g} "
            f"rad/s; sensors.gyro.rate_limit is {limit:g}"
        )
    check_order(world, context)


def _tensor(spacecraft):
    inertia = np.array(spacecraft.inertia, float)
    return np.diag(inertia) if inertia.ndim == 1 else inertia


def _wheels(world, spacecraft, least_moment, torque):
    axes = np.array(spacecraft.torque_axes, float)
    if len(axes) != 3 or abs(np.linalg.det(axes)) < 1e-6:
        raise ValueError(f"assurance is of three wheels about independent axes, not of {len(axes)}")
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    inertia = most(world.wheels.inertia)
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    tilt = _tilt(world)
    length = float(np.max(np.linalg.norm(signs @ axes, axis=1))) + 3 * tilt
    started = inertia * most(world.wheels.start_speed) * length
    return WheelBounds(
        axes=axes,
        tilt=tilt,
        length=length,
        share=3 * inertia / (least_moment - 3 * inertia),
        stored=low(world.wheels.inertia) * largest_speed(world),
        momentum=started + torque * spacecraft.duration,
    )


def _impulses(world, spacecraft, context, wheels):
    """Share and offset of :class:`Bounds`."""
    table, duration = np.asarray(context.torque_table, float), float(context.torque_duration)
    sizes = np.linalg.norm(table, axis=1)
    given, count = world.actuators, len(spacecraft.torque_axes)
    if given is None:
        return np.ones((2, len(sizes))), 0 * sizes
    number = np.maximum(np.arange(len(table)) - 1, 0)
    axis, level = number // 2 % count + 1, number // (2 * count) + 1
    fault = low(given.fault_gain), high(given.fault_gain)
    is_faulty = np.isin(axis, given.faulty_axes)
    least = low(given.gain) * np.where(is_faulty, min(1, fault[0]), 1)
    largest = high(given.gain) * np.where(is_faulty, max(1, fault[1]), 1)
    rounded = _largest_of(sizes, axis) * given.on_time_granularity / 2
    nothing = np.isin(level, given.dead_levels)
    nothing |= sizes * duration < given.minimum_impulse + rounded
    offset = largest * rounded
    if wheels is not None:
        limit = given.wheels.most_torque
        if limit is not None:
            least = np.minimum(least, low(limit) / np.maximum(sizes, 1e-30))
        nothing |= sizes * least < most(given.wheels.dead_band)
        offset += wheels.share * sizes * largest * duration
    least, offset = np.where(nothing, 0, least), np.where(sizes > 0, offset, 0)
    if context.agent_step.held:  # one that ends late is in the next period, whatever comes there
        offset += 2 * late(world, context) * INTEGRATION_STEP * np.max(sizes * largest)
    return np.stack([least, largest]), offset


def _tilt(world):
    given = world.actuators
    return 0.0 if given is None else math.radians(min(most(given.misalignment_deg), 180))


def _largest_of(sizes, axis):
    """Of each action, the largest torque about its axis."""
    return np.array([np.max(sizes[axis == x]) for x in axis])


def _rate_error(world, context, spacecraft):
    """Of an estimate that is no worse than the gyro's samples."""
    noise = context.knowledge.rate
    if noise is None:
        return 0.0
    gyro = world.sensors.gyro
    bias = 0.0 if noise.bias is None else float(noise.bias)
    random = DEVIATIONS * math.sqrt(3) * math.hypot(float(noise.sample), bias)
    scale, turned = most(gyro.scale_factor_ppm), most(gyro.misalignment_arcsec)
    return random + (PPM * scale + ARCSEC * turned) * spacecraft.rate_limit


def _attitude_error(context):
    noise = context.knowledge.attitude
    if noise is None:
        return 0.0
    return DEVIATIONS * math.hypot(noise.across, noise.across, noise.about)


def _waits(context):
    known = context.knowledge
    rate, attitude = (
        0.0 if x is None else INTEGRATION_STEP * (x.clock.period + x.clock.latency)
        for x in (known.rate, known.attitude)
    )
    return rate, attitude
