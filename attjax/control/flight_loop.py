"""What flies, with memory: an estimator, a predictor and a controller, as flight software has them.

In the ideal world, where the truth is told and torques come at once, it is the controller alone.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import chex
import jax
import jax.numpy as jnp
from flax import struct

from attjax.control import adaptation, belief, estimator, lateness
from attjax.control.assured import Assurance, ranking
from attjax.control.memory import Memory, unknowing
from attjax.dynamics import vectors
from attjax.dynamics.sensing import Measurement
from attjax.envs import observation as observations
from attjax.envs.context import Context
from attjax.envs.leaning import leaned


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
        return None if context.knowledge.is_truth else unknowing(context, self.adapts)

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
            torque = memory.estimate.torque
            if torque is not None:
                known = dataclasses.replace(known, disturbance=jnp.stack(torque))
            shown = leaned(observation, known)
        if self.assurance is None or self.scores is None:
            return self.controller(shown, known)
        looks_ahead = context.knowledge.delay or context.knowledge.delays
        if memory is not None and self.adapts and looks_ahead:
            estimate = memory.estimate
            if context.knowledge.is_told:  # whose bounds are of any torque, not of one estimated
                estimate = estimate.replace(torque=None)
            queue = memory.queue
            if memory.surprises is not None:
                queue = lateness.delayed(queue, context.knowledge.delay)
            observation = _ahead(estimate, adaptation.given(queue, context), context)
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
        queue, delay = memory.bodily(context), memory.delay(context)
        return _ahead(memory.estimate, queue, context, delay), memory

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
        if memory.surprises is not None:
            memory = memory.replace(surprises=memory.surprised(measurement, context))
        before, queue = (memory.estimate, memory.expected), memory.bodily(context)
        predicted, expected = estimator.predicted(*before, queue, last, context)
        identity = memory.identity
        if identity is not None:
            seen = memory.estimate, predicted, expected, estimator.told_by(measurement, context)
            commands = memory.commands(context)
            identity, predicted = adaptation.identified(identity, commands, seen, context)
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
        delay = context.knowledge.delay if memory.surprises is None else 0
        queue = memory.queue.and_then(delay, torque)
        return memory.replace(queue=queue, time=memory.time + 1, has_begun=jnp.ones((), bool))


def _ahead(estimate, queue, context, delay=None):
    """The observation of when the torque begins that is about to be commanded."""
    if context.knowledge.delay or delay is not None:
        estimate = belief.after_delay(estimate, queue, context, delay)
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
        scores: of all actions for it, as of :func:`attjax.control.assured.assured`; without an
            assurance they are not asked for.
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
