"""What flies, with memory: an estimator, a predictor and a controller, as flight software has them.

In the ideal world, where the truth is told and torques come at once, it is the controller alone.
"""

from collections.abc import Callable
from typing import Any

import chex
import jax
import jax.numpy as jnp
from flax import struct

from attjax.control import adaptation, belief, estimator, response
from attjax.control.assured import Assurance, ranking
from attjax.control.estimator import Estimate, Expected
from attjax.control.response import Identity
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
        has_begun: whether one of them was here.
        identity: of the spacecraft; None: it is taken to be as believed.
    """

    estimate: Estimate
    expected: Expected
    queue: Queue
    time: chex.Array
    has_begun: chex.Array
    identity: Identity | None = None


class FlightLoop(struct.PyTreeNode):
    """Estimator, predictor and controller: pure, and a tree of arrays.

    Attributes:
        controller: ``act(observation (11,), context) -> action``, a tree of arrays; None where
            there are scores.
        adapts: whether it identifies inertia and torques in flight, and flies by them.
        assurance: that lets through only actions that lead beyond no limit; None: there is none.
        scores: of all actions for it, ``scores(observation, context) -> (actions,)``.

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

    controller: Any
    adapts: bool = struct.field(pytree_node=False, default=False)
    assurance: Assurance | None = None
    scores: Callable[[chex.Array, Context], chex.Array] | None = None

    def init(self, context: Context) -> Memory | None:
        """The memory before the first decision; None where nothing need be remembered."""
        context = adaptation.filtering(context) if self.adapts else context
        known = context.knowledge
        if known.is_truth:
            return None
        least_steps = 1 + (0 if context.steps_after is not None else context.agent_step.frameskip)
        held, dtype = context.agent_step.held, context.inertia.dtype
        size = 3 if known.wheels is None else len(known.wheels.wheels.axes)
        size = response.valves_of(context) if self.adapts else size
        queue = empty_queue(known.delay, least_steps, held, dtype, size)
        identity = response.unknowing(context) if self.adapts else None
        new = jnp.zeros((), jnp.int32), jnp.zeros((), bool)
        return Memory(*estimator.unknowing(context), queue, *new, identity)

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
        action = self.act(memory, observation, context)
        return action, self.after(memory, action, context)

    def act(self, memory: Memory | None, observation: chex.Array, context: Context) -> chex.Array:
        """The action that is decided on; memory and observation as of :meth:`observed`.

        What is proved of an assurance is of the spacecraft that was believed before the flight and
        all within bounds of it. So it is told the rate as it is, not leaned, and a delay is looked
        across as was believed then; what has been identified is for the controller before it.
        """
        known, shown = self.believed(memory, context), observation
        if memory is not None and self.adapts:
            shown = adaptation.leaned(observation, memory.estimate.torque, known)
        if self.assurance is None or self.scores is None:
            return self.controller(shown, known)
        if memory is not None and self.adapts and known.knowledge.delay:
            estimate = memory.estimate
            if context.knowledge.is_told:  # whose bounds are of any torque, not of one estimated
                estimate = estimate.replace(torque=None)
            queue = adaptation.given(memory.queue, context)
            observation = _ahead(estimate, queue, context)
        return self.assurance.chosen(observation, self.scores(shown, known))

    def believed(self, memory: Memory | None, context: Context) -> Context:
        """The context that the controller is given: the same, or with what has been identified."""
        if memory is None or memory.identity is None:
            return context
        context = adaptation.filtering(context)
        return adaptation.believed(context, memory.identity, memory.queue)

    def observed(
        self, memory: Memory | None, measurement: Measurement, context: Context
    ) -> tuple[chex.Array, Memory | None]:
        """The observation (11,), and the memory with the estimate.

        It is of the moment at which the torque begins that the controller is about to command.

        Args:
            memory, measurement, context: as of :meth:`step`.
        """
        if memory is None:
            return _observation(measurement, context), None
        started = self._begun(memory, measurement, context)
        following = self._estimated(memory, measurement, context)
        return self._shown(vectors.chosen(memory.has_begun, following, started), context)

    def begun(self, measurement: Measurement, context: Context) -> tuple[chex.Array, Memory | None]:
        """As :meth:`observed`, at the first decision."""
        memory = self.init(context)
        if memory is None:
            return _observation(measurement, context), None
        return self._shown(self._begun(memory, measurement, context), context)

    def later(
        self, memory: Memory | None, measurement: Measurement, context: Context
    ) -> tuple[chex.Array, Memory | None]:
        """As :meth:`observed`, at any other decision."""
        if memory is None:
            return _observation(measurement, context), None
        return self._shown(self._estimated(memory, measurement, context), context)

    def _shown(self, memory, context):
        context = self.believed(memory, context)
        return _ahead(memory.estimate, _bodily(memory, context), context), memory

    def _begun(self, memory, measurement, context):
        """The memory with the estimate at the first decision."""
        context = self.believed(memory, context)
        first, identity = estimator.begun(memory.estimate, measurement, context), memory.identity
        if identity is not None:
            identity = adaptation.begun(identity, first)
        return memory.replace(estimate=first, identity=identity)

    def _estimated(self, memory, measurement, context):
        """The memory with the estimate at any other decision, and the queue seen from it."""
        last, context = memory.time - 1, self.believed(memory, context)
        before, queue = (memory.estimate, memory.expected), _bodily(memory, context)
        predicted, expected = estimator.predicted(*before, queue, last, context)
        identity = memory.identity
        if identity is not None:
            seen = memory.estimate, predicted, expected, estimator.told_by(measurement, context)
            identity, predicted = adaptation.identified(identity, memory.queue, seen, context)
        return memory.replace(
            estimate=estimator.corrected(predicted, expected, measurement, context),
            expected=expected,
            queue=memory.queue.later(belief.rk4_steps(context)),
            identity=identity,
        )

    def after(self, memory: Memory | None, action: chex.Array, context: Context) -> Memory | None:
        """The memory after an action; memory, action and context as of :meth:`step`."""
        if memory is None:
            return None
        command = belief.commanded_torque if memory.identity is None else adaptation.commanded
        torque = command(action, context)
        queue = memory.queue.and_then(context.knowledge.delay, torque)
        return memory.replace(queue=queue, time=memory.time + 1, has_begun=jnp.ones((), bool))


def _bodily(memory, context):
    """The queue of torques about the body's axes, or those of wheels."""
    if memory.identity is None:
        return memory.queue
    return adaptation.bodily(memory.queue, memory.identity, context)


def _ahead(estimate, queue, context):
    """The observation of when the torque begins that is about to be commanded."""
    if context.knowledge.delay:
        estimate = belief.after_delay(estimate, queue, context)
    return _observation(estimate, context)


def _observation(state, context):
    quaternion, rate = jnp.stack(state.quaternion), jnp.stack(state.angular_velocity)
    rules = context.kinematic_factor, context.observes_quaternion_rate
    return observations.observe(quaternion, rate, *rules)


def flight_loop(
    controller: Callable[[chex.Array, Context], Any] | None,
    *,
    adapts: bool = False,
    assurance: Assurance | None = None,
    scores: Callable[[chex.Array, Context], chex.Array] | None = None,
) -> FlightLoop:
    """A controller with the default estimator and predictor, and with an assurance if asked for.

    Args:
        controller: ``act(observation (11,), context) -> action``, or a flight loop already; None
            where there are scores.
        adapts: whether the loop identifies inertia and torques in flight, and flies by them.
        assurance: that stands after it (:func:`attjax.control.assured.assurance`).
        scores: of all actions for it, as of :func:`attjax.control.assured.assured`.
    """
    if isinstance(controller, FlightLoop):
        loop = controller
    else:
        is_tree = controller is None or isinstance(controller, jax.tree_util.Partial)
        loop = FlightLoop(controller if is_tree else jax.tree_util.Partial(controller))
    if adapts:
        loop = loop.replace(adapts=True)
    if assurance is not None:
        order = ranking(loop.controller, assurance, scores)
        loop = loop.replace(assurance=assurance, scores=order)
    return loop
