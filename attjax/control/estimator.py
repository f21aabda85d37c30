"""A multiplicative extended Kalman filter: attitude, rate, the gyro's bias, a constant torque.

Between two decisions the estimate moves as the believed spacecraft does under the torques that
were commanded, and its covariance with it; what the sensors say then corrects both. The error is
(θ, Δω, Δb, Δd): θ, rad, turns the estimated body frame into the true one, and d is the torque of
all disturbances, body frame. Biases and torques are estimated only in worlds that have them. All
noises follow from :class:`attjax.envs.knowledge.Knowledge`.
"""

from typing import Any

import chex
import jax.numpy as jnp
from flax import struct

from attjax.control import belief, covariance, linearized, measured
from attjax.control.covariance import Triangle
from attjax.dynamics import vectors
from attjax.dynamics.actuators import Queue
from attjax.dynamics.fused_loop import together
from attjax.dynamics.sensing import Measurement
from attjax.dynamics.vectors import Quaternion, Vector
from attjax.envs.context import Context
from attjax.spacecraft import INTEGRATION_STEP


class Estimate(struct.PyTreeNode):
    """What is estimated at a decision, by components.

    Attributes:
        quaternion: attitude, scalar last.
        angular_velocity: body frame, rad/s.
        bias: of the gyro, rad/s; None: it has none.
        torque: that disturbs, body frame, N m; None: nothing does.
        covariance: of the error (θ, Δω, Δb, Δd); None where the truth is told.
        wheel_speeds: of reaction wheels, rad/s, which are told; None: it has none.
    """

    quaternion: Quaternion
    angular_velocity: Vector
    bias: Vector | None
    torque: Vector | None
    covariance: Triangle | None
    wheel_speeds: tuple[Any, ...] | None = None


class Expected(struct.PyTreeNode):
    """What sensors with clocks of their own tell of the time between decisions; else None.

    Attributes:
        turn: of the body since the sample that the star tracker tells.
        waiting: since the newest that it has not yet told.
        age: of what it tells, s.
        rate: when the gyro sampled, rad/s.
    """

    turn: Quaternion | None
    waiting: Quaternion | None
    age: Any
    rate: Vector | None


def unknowing(context: Context) -> tuple[Estimate, Expected]:
    """Before anything is measured: numbers of no meaning."""
    known, zero = context.knowledge, jnp.zeros((), context.inertia.dtype)
    still, level = (zero,) * 3, (zero, zero, zero, zero + 1)
    attitude, rate = known.attitude, known.rate
    is_told = known.is_told and not known.is_filtered
    estimate = Estimate(
        quaternion=level,
        angular_velocity=still,
        bias=None if rate is None or rate.bias is None else still,
        torque=None if is_told or known.torque is None else still,
        covariance=None,
        wheel_speeds=None if known.wheels is None else (zero,) * len(known.wheels.wheels.axes),
    )
    if not is_told:
        size = linearized.size_of(estimate)
        estimate = estimate.replace(covariance=covariance.triangle(size, lambda i, j: zero))
    has_clock = [x is not None and x.clock.period > 0 for x in (attitude, rate)]
    turn = level if has_clock[0] else None
    age, sampled = zero if has_clock[0] else None, still if has_clock[1] else None
    return estimate, Expected(turn, turn, age, sampled)


def predicted(
    estimate: Estimate, expected: Expected, queue: Queue, time: chex.Array, context: Context
) -> tuple[Estimate, Expected]:
    """Both a control period later, before anything is measured there.

    Args:
        estimate, expected: at a decision.
        queue: of the torques commanded until then, that decision's included.
        time: decisions before it.
        context: of the loop.
    """
    motion = belief.one_period(estimate, queue, time, context)
    later = estimate.replace(quaternion=motion.quaternion, angular_velocity=motion.angular_velocity)
    if estimate.covariance is not None:
        model = linearized.model(queue, context)
        spread = together(linearized.covariance_after, estimate, motion, model)
        later = later.replace(covariance=spread)
    return later, expected_after(expected, motion, time, context)


def expected_after(
    expected: Expected, motion: belief.Motion, time: chex.Array, context: Context
) -> Expected:
    """What is expected of the sensors after a motion; arguments as of :func:`predicted`."""
    expected = expected.replace(rate=motion.sampled_rate)
    if expected.turn is None:
        return expected
    assert expected.waiting is not None and context.knowledge.attitude is not None
    clock = context.knowledge.attitude.clock
    start, now = (n * belief.rk4_steps(context) for n in (time, time + 1))
    told = clock.newest_told(start, now)
    waiting = vectors.then(expected.waiting, motion.turn)
    return expected.replace(
        turn=vectors.chosen(told > start, motion.since_sample, waiting),
        waiting=vectors.chosen(clock.newest_taken(now) > start, motion.since_sample, waiting),
        age=(now - told) * jnp.asarray(INTEGRATION_STEP, context.inertia.dtype),
    )


def corrected(
    estimate: Estimate, expected: Expected, measurement: Measurement, context: Context
) -> Estimate:
    """The estimate after a measurement.

    Args:
        estimate, expected: of :func:`predicted`.
        measurement: at that decision.
        context: of the loop.
    """
    told = told_by(measurement, context)
    if estimate.covariance is None:
        return _as_told(estimate, told)
    estimate = estimate.replace(wheel_speeds=told.wheel_speeds)
    noise = linearized.noise(context)
    estimate = together(measured.correct, estimate, expected, told, noise)
    return _as_told(estimate, told) if context.knowledge.is_told else estimate


def begun(estimate: Estimate, measurement: Measurement, context: Context) -> Estimate:
    """The estimate after the first measurement, of attitude and rate both."""
    told = told_by(measurement, context)
    first = _as_told(estimate, told)
    if estimate.covariance is None:
        return first
    return first.replace(covariance=measured.first_covariance(first, linearized.noise(context)))


def _as_told(estimate, told):
    return estimate.replace(
        quaternion=told.quaternion,
        angular_velocity=told.angular_velocity,
        wheel_speeds=told.wheel_speeds,
    )


def told_by(measurement: Measurement, context: Context) -> Measurement:
    """A measurement by components, whether there is one as 1 or 0."""
    dtype = context.inertia.dtype
    speeds = None if context.knowledge.wheels is None else measurement.wheel_speeds
    return Measurement(
        quaternion=tuple(measurement.quaternion),
        has_quaternion=jnp.asarray(measurement.has_quaternion, dtype),
        angular_velocity=tuple(measurement.angular_velocity),
        has_angular_velocity=jnp.asarray(measurement.has_angular_velocity, dtype),
        wheel_speeds=None if speeds is None else tuple(speeds),
    )
