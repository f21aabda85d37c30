"""How the spacecraft moves as it is believed to be, under the torques that were commanded."""

import functools
from typing import Any, NamedTuple

import chex
import jax.numpy as jnp

from attjax.dynamics import integration, vectors
from attjax.dynamics.actuators import Queue
from attjax.dynamics.bodies import body_of
from attjax.dynamics.disturbances import Acting
from attjax.dynamics.equations import Kinematics
from attjax.dynamics.forced_motion import ForcedEquations, ForcedState, Held, unseen
from attjax.dynamics.vectors import Quaternion, Vector
from attjax.envs.context import Context
from attjax.envs.torques import applied_torque, commanded
from attjax.spacecraft import INTEGRATION_STEP


class Motion(NamedTuple):
    """Where it is after a while, and where it was when the sensors sampled; by components.

    Attributes:
        quaternion, angular_velocity: at the end; rad/s.
        turn: of the body from the beginning to the end.
        since_sample: of the body since the star tracker sampled; None: it samples at decisions.
        sampled_rate: when the gyro did; None likewise.
    """

    quaternion: Quaternion
    angular_velocity: Vector
    turn: Quaternion
    since_sample: Quaternion | None
    sampled_rate: Vector | None


def rk4_steps(context: Context) -> chex.Numeric:
    """RK4 steps of a control period."""
    after = context.agent_step.frameskip if context.steps_after is None else context.steps_after
    return 1 + after


def one_period(estimate: Any, queue: Queue, time: chex.Array, context: Context) -> Motion:
    """The motion of a control period.

    Args:
        estimate: with quaternion, angular velocity and torque, by components.
        queue: of the torques commanded until its beginning.
        time: decisions until its beginning.
        context: of the spacecraft, its knowledge included.
    """
    start, end = (n * rk4_steps(context) for n in (time, time + 1))
    given = context.knowledge.attitude, context.knowledge.rate
    dtype = context.inertia.dtype
    samples = [
        jnp.asarray(x.clock.to_be_seen(start, end), dtype) if x and x.clock.period else None
        for x in given
    ]
    agent_step, limit = context.agent_step, context.steps_after
    limit = None if limit is None else jnp.asarray(limit, dtype)
    return _moved(estimate, queue, context, (agent_step, limit, samples))


def after_delay(
    estimate: Any, queue: Queue, context: Context, delay: chex.Array | None = None
) -> Any:
    """The motion, or the estimate, where the torque begins that is commanded now.

    Args:
        estimate, queue, context: as of :func:`one_period`.
        delay: RK4 steps, a number of the inertia's type; None: the delay that is known.
    """
    known = context.knowledge
    if delay is None:
        agent_step = context.agent_step._replace(frameskip=known.delay - 1)
        return _moved(estimate, queue, context, (agent_step, None, (None, None)))
    assert known.delays is not None
    agent_step = context.agent_step._replace(frameskip=known.delays[1] - 1)
    moved = _moved(estimate, queue, context, (agent_step, delay - 1, (None, None)))
    states = zip((moved.quaternion, moved.angular_velocity), _state(estimate))
    attitude, rate = (vectors.chosen(delay > 0, *both) for both in states)
    return moved._replace(quaternion=attitude, angular_velocity=rate)


def _state(estimate):
    return estimate.quaternion, estimate.angular_velocity


def _moved(estimate, queue, context, step):
    agent_step, limit, samples = step
    start = ForcedState(
        estimate.quaternion,
        estimate.angular_velocity,
        None,
        unseen(samples),
        None if estimate.wheel_speeds is None else (estimate.wheel_speeds, None),
    )
    known = context.knowledge.wheels
    equations = ForcedEquations(
        pulses=queue.pulses(),
        held=Held(agent_step.held),
        body=body_of(context.inertia, known and known.wheels),
        acting=Acting(None, None, estimate.torque),
        swinging=None,
        own=(),
        kinematics=Kinematics(agent_step.kinematic_factor),
        samples=tuple(samples),
    )
    change: Any = integration.change(agent_step, start, equations, limit)
    end = vectors.unit(vectors.add(start.quaternion, change.quaternion))
    turned, accelerated = change.seen
    since_sample = None
    if turned is not None:
        sampled = vectors.unit(vectors.add(start.quaternion, turned))
        since_sample = vectors.then(vectors.conjugate(sampled), end)
    return Motion(
        quaternion=end,
        angular_velocity=vectors.add(start.angular_velocity, change.angular_velocity),
        turn=vectors.then(vectors.conjugate(start.quaternion), end),
        since_sample=since_sample,
        sampled_rate=accelerated and vectors.add(start.angular_velocity, accelerated),
    )


def impulse(queue: Queue, context: Context) -> Vector:
    """What the commanded torques give in a control period, body frame, N m s."""
    given = [
        vectors.scaled(duration, pulse.torque)
        for duration, pulse in zip(durations(queue, context), queue.pulses())
    ]
    total = functools.reduce(vectors.add, given)
    known = context.knowledge.wheels
    return total if known is None else known.wheels.along_axes(total)


def durations(queue: Queue, context: Context) -> list[chex.Array]:
    """How long each of the queue's torques acts in a control period, s."""
    steps = rk4_steps(context)
    pulses, lasting = queue.pulses(), []
    starts = [jnp.clip(pulse.start, 0, steps) for pulse in pulses] + [steps]
    for pulse, start, following in zip(pulses, starts, starts[1:]):
        if context.agent_step.held:
            steps_on = following - start
        else:
            steps_on = jnp.where((pulse.start >= 0) & (pulse.start < steps), 1, 0)
        lasting.append(steps_on * INTEGRATION_STEP)
    return lasting


def commanded_torque(action: chex.Numeric, context: Context) -> chex.Array:
    """The torque (3,) that an action stands for, body frame, N m; of wheels, (axes,) along them."""
    known = context.knowledge.wheels
    if known is None:
        return applied_torque(action, context)
    axes = len(known.wheels.axes)
    amounts = commanded(action, context, axes, context.torque_duration).amounts
    return known.motors.torques(amounts)
