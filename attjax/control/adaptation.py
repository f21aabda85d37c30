"""What a flight loop believes of a spacecraft that it identifies, decision by decision."""

import dataclasses
from typing import Any

import chex
import jax.numpy as jnp

from attjax.control import belief, covariance, identification, linearized, measured, response
from attjax.control.covariance import product
from attjax.control.linearized import AXES
from attjax.control.response import Identity, Period
from attjax.dynamics import vectors
from attjax.dynamics.actuators import Queue
from attjax.dynamics.numerics import matmul
from attjax.envs.context import Context
from attjax.envs.torques import applied_torque


def filtering(context: Context) -> Context:
    """The context of a loop that estimates the rate even where the truth is told.

    Raises:
        ValueError: the spacecraft has reaction wheels.
    """
    known = context.knowledge
    if known.wheels is not None:
        raise ValueError("a flight loop cannot adapt to reaction wheels yet")
    return dataclasses.replace(context, knowledge=known.replace(is_filtered=True))


def commanded(action: chex.Numeric, context: Context) -> chex.Array:
    """(valves,) torques that an action asks for, of each level about each axis, N m, signed.

    Args:
        action: as of :func:`attjax.envs.torques.applied_torque`.
        context: as believed before the flight.
    """
    if context.continuous:
        return applied_torque(action, context)
    number = jnp.maximum(jnp.asarray(action) - 1, 0)
    sizes = jnp.linalg.norm(context.torque_table, axis=1)
    amount = jnp.where(number % 2 == 0, 1, -1) * sizes[action]
    valves = jnp.arange(response.valves_of(context))
    return jnp.where(valves == number // 2, amount, 0)


def torques(identity: Identity, context: Context) -> chex.Array:
    """(valves, 3) torques that come of 1 N m that is asked of each, body frame."""
    inertia, columns = identity.inertia, identity.columns
    axes = jnp.stack([jnp.stack(vectors.times(inertia, x)) for x in columns])
    strengths = jnp.stack(identity.strengths)
    repeated = jnp.tile(axes, (len(strengths) // len(columns), 1))
    return strengths[:, None] * repeated


def believed(context: Context, identity: Identity, queue: Queue) -> Context:
    """The context with what has been identified in place of what was believed before.

    Of real actions, which are fractions of torques about the body's axes, it is what these give
    about their own.

    Args:
        context: as believed before the flight.
        identity: of the spacecraft.
        queue: of torques commanded, (valves,) each.
    """
    known, table = context.knowledge, torques(identity, context)
    along, across, inertia = _shares(identity)
    is_on = jnp.any(queue.torques != 0, axis=0)
    weak = jnp.sum(jnp.where(is_on, jnp.stack(identity.variances), 0))
    known = known.replace(along=jnp.sqrt(along + weak), across=across, inertia=inertia)
    if context.continuous:
        rows = context.torque_table * jnp.diag(table)
    else:
        sizes = jnp.linalg.norm(context.torque_table[1:], axis=1)
        sign = jnp.tile(jnp.array([1, -1], sizes.dtype), len(table))
        rows = jnp.repeat(table, 2, axis=0) * (sign * sizes)[:, None]
        rows = jnp.concatenate([jnp.zeros_like(rows[:1]), rows])
    tensor = jnp.stack([jnp.stack(row) for row in identity.inertia])
    return dataclasses.replace(context, inertia=tensor, torque_table=rows, knowledge=known)


def _shares(identity):
    """Variance of a torque along its axis, and deviations across and of inertia, as shares."""
    root, inertia = identity.spread.response, jnp.stack([jnp.stack(x) for x in identity.inertia])
    along, across = [], []
    for a, column in enumerate(identity.columns):
        momentum = matmul(inertia, root[6 + 3 * a : 9 + 3 * a])
        size = matmul(inertia, jnp.stack(column)[:, None])
        square = jnp.maximum(jnp.sum(size**2), identification.LEAST)
        along.append(jnp.sum(jnp.sum(momentum * size, axis=0) ** 2) / square)
        across.append(jnp.maximum(jnp.sum(momentum**2) - along[-1], 0) / 2)
    rows = response.gyroscopic(identity.mobility, identity.rate)
    turning = matmul(inertia, jnp.stack([jnp.stack(row) for row in rows]))
    swung = jnp.sum(matmul(turning, root[:6]) ** 2)
    momentum = matmul(inertia, jnp.stack(identity.rate)[:, None])
    most = jnp.sum(jnp.stack(identity.rate) ** 2) * jnp.sum(momentum**2)
    share = jnp.sqrt(swung / jnp.maximum(most, identification.LEAST))
    return jnp.max(jnp.stack(along)), jnp.sqrt(jnp.max(jnp.stack(across))), share


def bodily(queue: Queue, identity: Identity, context: Context) -> Queue:
    """The queue of torques about the body's axes, of one of (valves,) each."""
    return _along(torques(identity, context), queue)


def given(queue: Queue, context: Context) -> Queue:
    """The same, of torques as they were believed to be before the flight."""
    axes = response.torque_directions(context)
    return _along(jnp.tile(axes, (queue.torques.shape[1] // len(axes), 1)), queue)


def _along(table, queue):
    found = jnp.sum(queue.torques[:, :, None] * table, axis=1)
    return Queue(queue.starts, found)


def begun(identity: Identity, estimate: Any) -> Identity:
    """The identity with the first rate that was measured.

    Args:
        identity: before the first decision.
        estimate: of the first measurement.
    """
    spread = identity.spread._replace(rate=_of_what_gyros_tell(estimate))
    rate = vectors.add(estimate.angular_velocity, _bias(estimate))
    return identity.replace(rate=rate, spread=spread)


def _bias(estimate):
    """Of the gyro, rad/s."""
    return (0.0,) * 3 if estimate.bias is None else estimate.bias


def _of_what_gyros_tell(estimate):
    """(3, 3) covariance of the sum of rate and bias: of a sample, however unknown the bias is."""
    parts = [3] if estimate.bias is None else [3, 6]

    def element(i, j):
        return sum(covariance.at(estimate.covariance, m + i, n + j) for m in parts for n in parts)

    return jnp.stack([jnp.stack([element(i, j) for j in AXES]) for i in AXES])


def identified(
    identity: Identity, queue: Queue, estimates: tuple[Any, Any, Any, Any], context: Context
) -> tuple[Identity, Any]:
    """The identity after a measurement, and the estimate that was predicted, its doubts opened.

    Args:
        identity: at the decision before.
        queue: of torques commanded until then, (valves,) each.
        estimates: then; predicted for now; what was expected of the sensors; what they told.
        context: as believed then.
    """
    estimate, predicted, expected, told = estimates
    noise = linearized.noise(context)
    model = linearized.model(bodily(queue, identity, context), context)
    durations = jnp.stack(belief.durations(queue, context))
    impulses = tuple(jnp.sum(durations[:, None] * queue.torques, axis=0))
    steps = jnp.asarray(belief.rk4_steps(context), context.inertia.dtype)
    numbers = measured.innovations(predicted, expected, told, noise)[:3]
    floor = least_change(model, context) ** 2
    numbers = [x._replace(variance=x.variance + floor) for x in numbers]
    before, after = estimate.angular_velocity, predicted.angular_velocity
    unexplained = _unexplained(estimate, after, model, steps)
    period = Period(before, after, impulses, unexplained, _bias(estimate))
    identity, change = identification.corrected(identity, period, numbers, model)
    added = [change * x.innovation * x.innovation for x in numbers]
    size = len(predicted.covariance)
    spread = covariance.triangle(
        size,
        lambda i, j: predicted.covariance[i][j - i] + (added[i - 3] if 3 <= i == j < 6 else 0),
    )
    return identity, predicted.replace(covariance=spread)


def least_change(model: linearized.Model, context: Context) -> chex.Array:
    """RESOLVED of the least that a command changes the rate by, rad/s."""
    sizes = jnp.linalg.norm(context.torque_table, axis=1)
    weakest = jnp.min(jnp.where(sizes > 0, sizes, jnp.inf))
    least = jnp.min(jnp.stack([row[i] for i, row in enumerate(model.inverse)]))
    return identification.RESOLVED * weakest * context.torque_duration * least


def _unexplained(estimate, after, model, steps):
    """Variances that rounding, a gyro's bias and a torque not known well add to what it tells."""
    size, gyro = len(estimate.covariance), model.knowledge.rate
    rate = estimate.angular_velocity
    found = [steps * model.rounding * (x * x + measured.LEAST) for x in rate]
    if estimate.bias is not None:
        turning = gyro.share_of(tuple(y - x for x, y in zip(rate, after)), rate)
        found = [x + gyro.walk**2 * model.period + y for x, y in zip(found, turning)]
    if estimate.torque is None:
        return tuple(found)
    spread = [covariance.at(estimate.covariance, size - 3 + i, size - 3 + i) for i in AXES]
    rows = model.inverse
    pushed = [product([x * x for x in row], spread) * model.period**2 for row in rows]
    return tuple(x + y for x, y in zip(found, pushed))
