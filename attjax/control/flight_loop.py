"""What flies, with memory: an estimator, a predictor and a controller, as flight software has them.

In the ideal world, where the truth is told and torques come at once, it is the controller alone.
"""

from collections.abc import Callable
from typing import Any

import chex
import jax
import jax.numpy as jnp
from flax import struct

from attjax.control import belief, estimator
from attjax.control.assured import Assurance, assured
from attjax.control.estimator import Estimate, Expected
from attjax.dynamics import vectors
from attjax.dynamics.actuators import Queue, empty_queue
from attjax.dynamics.sensing import Measurement
from attjax.envs import observation as observations
from attjax.envs.context import Context


class Memory(struct.PyTreeNode):
    """What a flight loop remembers from one decision to the next.

    Attributes:
        estimate: at the last decision.
        expected: of sensors that sample between decisions.
        queue: of the torques that were commanded.
        time: decisions so far, int32.
    """

    estimate: Estimate
    expected: Expected
    queue: Queue
    time: chex.Array


class FlightLoop(struct.PyTreeNode):
    """Estimator, predictor and controller: pure, and a tree of arrays.

    Attributes:
        controller: ``act(observation (11,), context) -> action``, a tree of arrays.

    Example:
        >>> from attjax import AttitudeEnv
        >>> from attjax.control.classical import phase_plane
        >>> env = AttitudeEnv(frameskip=5)
        >>> context, loop = env.context(env.default_params), flight_loop(phase_plane)
        >>> turned = Measurement(jnp.array([0.6, 0.0, 0.0, 0.8]), True, jnp.zeros(3), True)
        >>> action, memory = loop.step(loop.init(context), turned, context)
        >>> int(action)
        2
    """

    controller: Callable[[chex.Array, Context], chex.Array]

    def init(self, context: Context) -> Memory | None:
        """The memory before the first decision; None where nothing need be remembered."""
        known = context.knowledge
        if known.is_truth:
            return None
        least_steps = 1 + (0 if context.steps_after is not None else context.agent_step.frameskip)
        held, dtype = context.agent_step.held, context.inertia.dtype
        size = 3 if known.wheels is None else len(known.wheels.wheels.axes)
        queue = empty_queue(known.delay, least_steps, held, dtype, size)
        return Memory(*estimator.unknowing(context), queue, jnp.zeros((), jnp.int32))

    def step(
        self, memory: Memory | None, measurement: Measurement, context: Context
    ) -> tuple[chex.Array, Memory | None]:
        """A decision.

        Args:
            memory: after the last.
            measurement: what the sensors say.
            context: what is known of the spacecraft and its world.

        Returns:
            The action, an integer scalar or (3,) fractions, and the memory after it.
        """
        observation, memory = self.observed(memory, measurement, context)
        action = self.controller(observation, context)
        return action, self.after(memory, action, context)

    def observed(
        self, memory: Memory | None, measurement: Measurement, context: Context
    ) -> tuple[chex.Array, Memory | None]:
        """The observation (11,) that the controller is given, and the memory with the estimate.

        It is of the moment at which the torque begins that the controller is about to command.

        Args:
            memory, measurement, context: as of :meth:`step`.
        """
        state: Any = measurement
        if memory is not None:
            memory = _estimated(memory, measurement, context)
            state = memory.estimate
            if context.knowledge.delay:
                state = belief.after_delay(state, memory.queue, context)
        quaternion, rate = jnp.stack(state.quaternion), jnp.stack(state.angular_velocity)
        rules = context.kinematic_factor, context.observes_quaternion_rate
        return observations.observe(quaternion, rate, *rules), memory

    def after(self, memory: Memory | None, action: chex.Array, context: Context) -> Memory | None:
        """The memory after an action; memory, action and context as of :meth:`step`."""
        if memory is None:
            return None
        torque = belief.commanded_torque(action, context)
        queue = memory.queue.and_then(context.knowledge.delay, torque)
        return memory.replace(queue=queue, time=memory.time + 1)


def _estimated(memory, measurement, context):
    """The memory with the estimate at this decision, and the queue seen from it."""
    queue, last = memory.queue, memory.time - 1
    before = memory.estimate, memory.expected
    predicted, expected = estimator.predicted(*before, queue, last, context)
    estimate = estimator.corrected(predicted, expected, measurement, context)
    first = estimator.begun(memory.estimate, measurement, context)
    has_begun = memory.time > 0
    queue = vectors.chosen(has_begun, queue.later(belief.rk4_steps(context)), queue)
    return memory.replace(
        estimate=vectors.chosen(has_begun, estimate, first),
        expected=vectors.chosen(has_begun, expected, memory.expected),
        queue=queue,
    )


def flight_loop(
    controller: Callable[[chex.Array, Context], Any],
    *,
    assurance: Assurance | None = None,
    scores: Callable[[chex.Array, Context], chex.Array] | None = None,
) -> FlightLoop:
    """A controller with the default estimator and predictor, and with an assurance if asked for.

    Args:
        controller: ``act(observation (11,), context) -> action``, or a flight loop already.
        assurance: that stands after it (:func:`attjax.control.assured.assurance`).
        scores: of all actions for it, as of :func:`attjax.control.assured.assured`.
    """
    if isinstance(controller, FlightLoop):
        if assurance is None:
            return controller
        controller = controller.controller
    if assurance is not None:
        return FlightLoop(assured(controller, assurance, scores))
    is_tree = isinstance(controller, jax.tree_util.Partial)
    return FlightLoop(controller if is_tree else jax.tree_util.Partial(controller))
