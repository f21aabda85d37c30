"""Errors of an estimate to first order: how they grow in a control period.

By components, for :mod:`attjax.control.estimator`: three each of θ, Δω and, where there are any, of
bias and torque.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from attjax.control import belief, covariance
from attjax.control.covariance import ONE, Triangle, product
from attjax.dynamics import vectors
from attjax.dynamics.actuators import Queue
from attjax.dynamics.bodies import body_of
from attjax.dynamics.forced_motion import Held
from attjax.dynamics.vectors import Matrix, Vector
from attjax.envs.context import Context
from attjax.envs.knowledge import AttitudeNoise, Knowledge, RateNoise

AXES = range(3)


class Model(NamedTuple):
    """What the growth of errors depends on beside the motion.

    Attributes:
        inertia, inverse: rows, or the diagonal, kg m² and 1/(kg m²).
        impulse: that was commanded in the control period, body frame, N m s.
        period: s.
        turning: attitude's rate of change over the angular velocity: 1 by Eq. 9.
        rounding: variance of a number's rounding, as a share of its square.
        knowledge: of the world.
        held: whether torques last through a control period.
    """

    inertia: Matrix | Vector
    inverse: Matrix | Vector
    impulse: Vector
    period: Any
    turning: Any
    rounding: Any
    knowledge: Knowledge
    held: Held


class Noise(NamedTuple):
    """Of what is measured.

    Attributes:
        attitude, rate: as of :class:`Knowledge`.
        torque: variance of a disturbance at the start, N² m²; None where there is none.
        rounding, turning, period: as of :class:`Model`.
    """

    attitude: AttitudeNoise | None
    rate: RateNoise | None
    torque: Any
    rounding: Any
    turning: Any
    period: Any


def model(queue: Queue, context: Context) -> Model:
    """The model of a control period, from the torques commanded until its beginning."""
    inertia = context.inertia
    rows = vectors.components(inertia)
    impulse = belief.impulse(queue, context)
    turning = 2 * context.kinematic_factor
    period, wheels = context.control_period, context.knowledge.wheels
    inverse = body_of(inertia, wheels and wheels.wheels).inverse
    numbers = rows, inverse, impulse, period, turning, _rounding(context), context.knowledge
    return Model(*_in_one_type((*numbers, Held(context.agent_step.held)), context))


def noise(context: Context) -> Noise:
    """The noise of what is measured."""
    known, turning = context.knowledge, 2 * context.kinematic_factor
    torque = None if known.torque is None else known.torque.variance
    period = context.control_period
    of_this = known.attitude, known.rate, torque, _rounding(context), turning, period
    return Noise(*_in_one_type(of_this, context))


def _in_one_type(tree, context):
    return jax.tree.map(lambda x: jnp.asarray(x, context.inertia.dtype), tree)


def _rounding(context):
    return float(jnp.finfo(context.inertia.dtype).eps) ** 2


def size_of(estimate: Any) -> int:
    """How many errors an estimate has."""
    return 6 + 3 * (estimate.bias is not None) + 3 * (estimate.torque is not None)


def covariance_after(estimate: Any, motion: belief.Motion, model: Model) -> Triangle:
    """The covariance at the end of a control period.

    Args:
        estimate: at its beginning.
        motion, model: of it.
    """
    size, known, period = size_of(estimate), model.knowledge, model.period
    rate = vectors.add(estimate.angular_velocity, motion.angular_velocity)
    rate = vectors.scaled(0.5, rate)
    at_once, steadily = _rate_noise(rate, model)
    turning = [0] * 3
    if known.rate is not None:
        change = _change(estimate.angular_velocity, motion.angular_velocity)
        turning = known.rate.share_of(change, rate)
    before = covariance.triangle(
        size,
        lambda i, j: estimate.covariance[i][j - i] + (at_once[i - 3] if 3 <= i == j < 6 else 0),
    )
    rounding = model.rounding * vectors.dot(motion.quaternion[:3], motion.quaternion[:3])
    half = model.turning * period / 2
    added = {}
    for i in AXES:
        added[i, i] = half**2 * steadily[i] + rounding
        added[i, 3 + i] = half * steadily[i]
        added[3 + i, 3 + i] = steadily[i]
        if known.rate is not None and estimate.bias is not None:
            added[6 + i, 6 + i] = known.rate.walk**2 * period + turning[i]
        if known.torque is not None and estimate.torque is not None:
            walk = known.torque.walk(_length(rate)) * period
            added[size - 3 + i, size - 3 + i] = walk
    return covariance.propagated(before, _transition(estimate, motion, rate, model), added)


def _rate_noise(rate, model):
    """Variances that torques and moments which are not as believed add to the rate's, each axis.

    They are wrong by the same share all the time. From rest to the momentum h the rate's error
    grows to a share σ of I⁻¹h, its variance by σ² (2 h dh + dh²) with each impulse dh.

    Returns:
        What pulses add when the period begins, and what is added all through it.
    """
    known, period = model.knowledge, model.period
    momentum, rows = vectors.times(model.inertia, rate), _rows(model.inverse)
    length, given = _length(momentum), _length(model.impulse)
    turned = period * _length(rate) * length
    across = known.across**2 * given * (given + 2 * length)
    gyroscopic = known.inertia**2 * turned * (turned + 2 * length) / 3
    pulsed, steady = [], []
    for row, speed in zip(rows, rate):
        kick, squared = product(row, model.impulse), product(row, row)
        along = known.along**2 * abs(kick) * (abs(kick) + 2 * abs(speed))
        pulsed.append(along + across * squared)
        steady.append(gyroscopic * squared + model.rounding * speed * speed)
    if not model.held.value:
        return pulsed, steady
    return [jnp.zeros_like(x) for x in pulsed], [x + y for x, y in zip(pulsed, steady)]


def _change(before, after):
    return tuple(y - x for x, y in zip(before, after))


def _length(vector):
    return jnp.sqrt(vectors.dot(vector, vector))


def _transition(estimate, motion, rate, model):
    """The errors after a control period, a row each, by those before it."""
    period, inverse = model.period, _rows(model.inverse)
    turned = vectors.attitude_matrix(motion.turn)
    momentum = vectors.times(model.inertia, rate)
    if model.knowledge.wheels is not None:
        aboard = model.knowledge.wheels.wheels.momentum(estimate.wheel_speeds)
        momentum = vectors.add(momentum, aboard)
    slowed = rate_transition(momentum, rate, model)
    half = model.turning * period / 2
    drifted = [[half * (turned[i][j] + slowed[i][j]) for j in AXES] for i in AXES]
    nothing: list[Any] = [None] * 3
    bias, torque = estimate.bias is not None, estimate.torque is not None
    rows = []
    for i in AXES:
        pushed = [_times(half * period, x) for x in inverse[i]]
        rows.append([*turned[i], *drifted[i], *nothing * bias, *pushed * torque])
    for i in AXES:
        pushed = [_times(period, x) for x in inverse[i]]
        rows.append([*nothing, *slowed[i], *nothing * bias, *pushed * torque])
    for i in range(6, size_of(estimate)):
        rows.append([ONE if i == j else None for j in range(size_of(estimate))])
    return rows


def rate_transition(momentum: Vector, rate: Vector, model: Model) -> list[list[Any]]:
    """exp(A Δt) to second order, where A = I⁻¹ (h× − ω× I) with the momentum h, by Eq. 6.

    Args:
        momentum: h, N m s.
        rate: ω, rad/s.
        model: of the period.
    """
    spun = [[product(row, column) for column in zip(*_rows(model.inertia))] for row in _skew(rate)]
    gyroscopic = [
        [_sum(x, _times(-1, y)) for x, y in zip(*rows)] for rows in zip(_skew(momentum), spun)
    ]
    growth = [
        [_times(model.period, product(row, column)) for column in zip(*gyroscopic)]
        for row in _rows(model.inverse)
    ]
    columns = list(zip(*growth))
    return [
        [
            _sum(1 if i == j else 0, growth[i][j], _times(0.5, product(growth[i], columns[j])))
            for j in AXES
        ]
        for i in AXES
    ]


def _rows(matrix):
    """Rows of a matrix; a diagonal's other elements are None."""
    if isinstance(matrix[0], tuple):
        return matrix
    return [[matrix[i] if i == j else None for j in AXES] for i in AXES]


def _skew(a):
    return [[None, -a[2], a[1]], [a[2], None, -a[0]], [-a[1], a[0], None]]


def _times(factor, x):
    return None if x is None else factor * x


def _sum(*terms):
    given = [x for x in terms if x is not None]
    return sum(given[1:], given[0]) if given else None
