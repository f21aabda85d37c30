"""What a flight loop remembers, and what it makes of it."""

import chex
import jax.numpy as jnp
from flax import struct

from attjax.control import adaptation, estimator, lateness, linearized, response
from attjax.control.estimator import Estimate, Expected
from attjax.control.response import Identity
from attjax.dynamics.actuators import Queue, empty_queue
from attjax.dynamics.sensing import Measurement
from attjax.envs.context import Context


class Memory(struct.PyTreeNode):
    """What a flight loop remembers from one decision to the next.

    Attributes:
        estimate: at the last decision.
        expected: of sensors that sample between decisions.
        queue: of the torques that were commanded.
        time: decisions so far, int32.
        has_begun: whether one of them was here.
        identity: of the spacecraft; None: it is taken to be as believed.
        surprises: of each delay that can be (:mod:`attjax.control.lateness`), and the queue's
            commands begin when they were given; None: the delay is taken to be as believed.
    """

    estimate: Estimate
    expected: Expected
    queue: Queue
    time: chex.Array
    has_begun: chex.Array
    identity: Identity | None = None
    surprises: chex.Array | None = None

    def delay(self, context: Context) -> chex.Array | None:
        """From a command to its torque, as it has been identified, RK4 steps; None: as believed."""
        return None if self.surprises is None else lateness.believed(self.surprises, context)

    def commands(self, context: Context) -> Queue:
        """The queue of torques commanded, which begin when they are believed to."""
        delay = self.delay(context)
        return self.queue if delay is None else lateness.delayed(self.queue, delay)

    def bodily(self, context: Context) -> Queue:
        """The same of torques about the body's axes, or those of wheels."""
        commands = self.commands(context)
        if self.identity is None:
            return commands
        return adaptation.bodily(commands, self.identity, context)

    def surprised(self, measurement: Measurement, context: Context) -> chex.Array:
        """What a measurement makes of the surprises of delays.

        Args:
            measurement: at the decision after that of the estimate.
            context: as believed.
        """
        assert self.identity is not None
        queue = adaptation.bodily(self.queue, self.identity, context)
        told = estimator.told_by(measurement, context)
        least = adaptation.least_change(linearized.model(queue, context), context)
        seen = self.estimate, self.expected, told, linearized.noise(context), least
        return lateness.judged(self.surprises, queue, seen, self.time - 1, context)


def unknowing(context: Context, adapts: bool) -> Memory:
    """Before the first decision.

    Args:
        context: of the loop.
        adapts: whether inertia, torques and delay are identified.
    """
    known, dtype, axes = context.knowledge, context.inertia.dtype, 3
    if known.wheels is not None:
        axes = len(known.wheels.wheels.axes)
    identity, surprises, most = None, None, known.delay
    if adapts:
        axes, identity = response.valves_of(context), response.unknowing(context)
        if known.delays is not None:
            surprises, most = lateness.unknowing(context), known.delays[1]
    least_steps = 1 + (0 if context.steps_after is not None else context.agent_step.frameskip)
    queue = empty_queue(most, least_steps, context.agent_step.held, dtype, axes)
    new = jnp.zeros((), jnp.int32), jnp.zeros((), bool)
    return Memory(*estimator.unknowing(context), queue, *new, identity, surprises)
