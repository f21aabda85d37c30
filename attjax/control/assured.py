"""Run-time assurance: of a finite set of actions, those alone that lead beyond no limit.

An action is let through if, for every plant within the bounds and every disturbance, the
spacecraft can be braked after it within all limits: the rate, the wheels' speeds, keep-out cones.
The braking action itself always is. What is proved, and under which assumptions: docs/assurance.md.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax.control.keep_out import Cones, cones_of
from attjax.control.plants import Plants, plants
from attjax.control.stopping import RATIO, Stopping, coasting, stopping
from attjax.dynamics.numerics import matmul, square_root
from attjax.envs import observation as observations
from attjax.envs.bounds import Bounds, bounds
from attjax.envs.context import Context
from attjax.spacecraft import INTEGRATION_STEP
from attjax.world.keep_out import KeepOut

if TYPE_CHECKING:
    from attjax.envs.attitude import AttitudeEnv

ROOM = 1e-3
"""Share of a limit that is left to rounding in single precision."""

LEVELS, LOWER = 16, 0.9
"""Levels of P that are tried, each so much of the one before: the first is taken where braking is
certain, as it must be stronger than what turns a wheel's momentum with the body.
"""

MOST_TURNING = 3**-0.5
"""Of any body, ‖I⁻¹(ω × Iω)‖ ≤ ‖ω‖²/√3: its factors (Iⱼ − Iₖ)/Iᵢ are at most 1."""


class Assurance(struct.PyTreeNode):
    """What the assurance needs of a spacecraft, whatever its state.

    Attributes:
        plants: that it is for.
        stopping: what braking does to them.
        period: between two decisions, s.
        limit: of P, of which rate and wheels' speeds follow, rad/s.
        error: of the rate that is told, when a torque begins, rad/s.
        cones: that are kept out of; None: there are none.
        reserve: of each angle, for errors and for what is left of the rate after braking, rad.
    """

    plants: Plants
    stopping: Stopping
    period: chex.Array
    limit: chex.Array
    error: chex.Array
    cones: Cones | None
    reserve: chex.Array

    @property
    def is_certain(self) -> chex.Array:
        """Whether the proof holds: it needs torques that are stronger than all that acts on it."""
        knee = RATIO * self.limit
        grown = coasting(self.plants, knee, self.error)
        is_strong = self.stopping.is_certain & (knee**2 + grown <= self.limit**2)
        if self.cones is not None:
            return is_strong
        return is_strong | (coasting(self.plants, self.limit, self.error) <= 0)

    def changes(self, rate: chex.Array) -> tuple[chex.Array, chex.Array]:
        """The most that P², (rad/s)², is at a rate (3,), and (actions,) that it changes by."""
        rate = matmul(rate, self.plants.axes)
        peak = self.plants.peak(rate, self.error)
        beside = self.plants.beside(jnp.minimum(peak, self.limit), self.error)
        return peak**2, 2 * self.plants.work(rate) + beside

    def admissible(self, quaternion: chex.Array, rate: chex.Array) -> chex.Array:
        """Which actions are let through: (actions,) bool, at least one of them true.

        Args:
            quaternion, rate: (4,) and (3,), as told, of when the torque begins.
        """
        squared, change = self.changes(rate)
        keeps = (squared + change <= self.limit**2) | (change <= 0)
        if self.cones is not None:
            clearance = jnp.min(self.cones.clearance(quaternion)) / self.cones.per_rate
            most = square_root(squared) + jnp.max(self.plants.most_growth)
            angle = clearance - self.reserve - self.period * most
            keeps &= squared + change <= self.stopping.peak(angle) ** 2
        return keeps | (jnp.arange(len(change)) == jnp.argmin(change))

    def chosen(self, observation: chex.Array, scores: chex.Array) -> chex.Array:
        """The best of the actions that are let through, by (actions,) scores; int32."""
        quaternion = observation[observations.QUATERNION]
        allowed = self.admissible(quaternion, observation[observations.ANGULAR_VELOCITY])
        return jnp.argmax(jnp.where(allowed, scores, -jnp.inf))

    def closeness(self, action: chex.Array) -> chex.Array:
        """(actions,) scores of a controller that wants one action: how near the impulses are."""
        missing = self.plants.impulse - self.plants.impulse[action]
        # To itself it is nearest, whatever else has the same impulse.
        is_wanted = jnp.arange(len(missing)) == action
        return jnp.where(is_wanted, 1.0, -jnp.sum(missing**2, axis=-1))


def assurance(env: "AttitudeEnv", keep_out: Sequence[KeepOut] = ()) -> Assurance:
    """The assurance of a spacecraft in its world, as far as the world's description says.

    Args:
        env: what flies.
        keep_out: cones.

    Raises:
        ValueError: the world has something that has no bound, or wheels that cannot store what
            the spacecraft starts with.

    Example:
        >>> from attjax import AttitudeEnv
        >>> assured = assurance(AttitudeEnv(frameskip=5))
        >>> level = jnp.array([0.0, 0.0, 0.0, 1.0])
        >>> fast = assured.admissible(level, jnp.array([0.0, 0.4994, 0.0]))
        >>> bool(assured.is_certain), int(fast.sum()), bool(fast[3])
        (True, 16, False)
    """
    context = env.context(env.default_params)
    return of_bounds(context, bounds(env.world, env.spacecraft, context), keep_out)


def of_bounds(context: Context, within: Bounds, keep_out: Sequence[KeepOut] = ()) -> Assurance:
    """The assurance of a spacecraft within bounds.

    Args:
        context: of the loop.
        within: what it holds for.
        keep_out: cones.

    Raises:
        ValueError: the wheels cannot store what the spacecraft starts with.
    """
    limit = (1 - ROOM) * context.rate_limit
    of_these = plants(context, within)
    if within.wheels is not None:
        limit = jnp.minimum(limit, _level_of_wheels(of_these, within))
    levels = (limit * LOWER**n for n in range(LEVELS))
    tried = (_at_level(of_these, context, within, level, keep_out) for level in levels)
    first = next(tried)
    return next((x for x in itertools.chain([first], tried) if x.is_certain), first)


def _at_level(of_these, context, within, limit, keep_out):
    error, at_angle = _errors(of_these, context, within, limit)
    braking = stopping(of_these, limit, error, context.control_period, within.duration)
    reserve = at_angle + braking.rest * within.duration
    cones, period = cones_of(keep_out, context), jnp.asarray(context.control_period)
    return Assurance(of_these, braking, period, limit, error, cones, reserve)


def _errors(of_these, context, within, limit):
    """Of rate, rad/s, and attitude, rad, when a torque begins, of an action that is decided now."""
    delay = context.knowledge.delay * INTEGRATION_STEP
    late, (rate_wait, attitude_wait) = within.late * INTEGRATION_STEP, within.waits
    steps, pushed = context.control_period, of_these.pushed / context.control_period
    is_off = within.factors != (1.0, 1.0) or within.turned > 0
    turning = 2 * MOST_TURNING * limit**2
    if within.wheels is not None:
        heaviest = jnp.max(1 / of_these.coefficients.least_work)
        turning = 2 * limit * (of_these.linear + of_these.inverse * heaviest * limit)
    astray = (turning if is_off else 0.0) + pushed
    unknown = rate_wait + delay
    count = jnp.ceil(unknown / steps - 1e-3) + (1 if context.agent_step.held and unknown else 0)
    share = jnp.max(jnp.abs(of_these.share - 1), axis=0) + of_these.share[1] * of_these.tilt
    sizes = jnp.sqrt(jnp.sum(of_these.impulse**2, axis=-1))

    def kick(shares):
        return of_these.inverse * jnp.max(shares * sizes + jnp.asarray(within.offset))

    error = within.rate + unknown * astray + count * kick(share)
    error = error + within.uncounted * kick(of_these.share[1])
    error = error * jnp.exp(2 * limit * unknown)
    error = error + late * (MOST_TURNING * limit**2 + pushed) + 1e-6 * limit
    at_angle = within.attitude + (attitude_wait + delay) * error + late * limit
    return jnp.asarray(error, limit.dtype), jnp.asarray(at_angle, limit.dtype)


def _level_of_wheels(of_these, within):
    """‖ω‖ that leaves no wheel more to store than it can, whatever the direction, rad/s.

    Of wheels about unit vectors aᵢ, the rows of N, the momentum of each is bᵢ·(H − Iω), with bᵢ the
    columns of N⁻¹.
    """
    wheels, axes = within.wheels, np.asarray(of_these.axes, float)
    inverse = np.linalg.inv(wheels.axes)
    size, tilted = np.linalg.norm(inverse, 2), 3**0.5 * wheels.tilt
    off = size**2 * tilted / (1 - size * tilted)
    rows = inverse.T @ axes
    lengths = np.linalg.norm(rows, axis=1)
    moments = 1 / np.asarray(of_these.coefficients.least_work, float)
    turned = float(of_these.turned) * lengths + off
    most = np.linalg.norm(moments * rows, axis=1) + moments.max() * turned
    level = np.min((wheels.stored - (lengths + off) * wheels.momentum) / most)
    if not level > 0:
        raise ValueError(
            f"wheels store {wheels.stored:.3g} N m s each, and body and wheels can have "
            f"{wheels.momentum:.3g} from the start: nothing is left to turn with"
        )
    return level


def assured(
    controller: Callable[[chex.Array, Context], chex.Array],
    assurance: Assurance,
    scores: Callable[[chex.Array, Context], chex.Array] | None = None,
) -> Any:
    """A controller under assurance, which is a controller again.

    Args:
        controller: ``act(observation (11,), context) -> action``.
        assurance: of what flies.
        scores: of all actions, ``scores(observation, context) -> (actions,)``, the best the
            largest; None: the nearer an action's impulse to the one that is wanted, the better.
    """
    return jax.tree_util.Partial(_best, ranking(controller, assurance, scores), assurance)


def ranking(
    controller: Callable[[chex.Array, Context], chex.Array],
    assurance: Assurance,
    scores: Callable[[chex.Array, Context], chex.Array] | None = None,
) -> jax.tree_util.Partial:
    """Scores of all actions, ``scores(observation, context) -> (actions,)``, as of :func:`assured`.

    Args:
        controller, assurance, scores: as of :func:`assured`.
    """
    given = controller if scores is None else scores
    if not isinstance(given, jax.tree_util.Partial):
        given = jax.tree_util.Partial(given)
    return given if scores is not None else jax.tree_util.Partial(_nearness, given, assurance)


def _nearness(controller, assurance, observation, context):
    return assurance.closeness(controller(observation, context))


def _best(scores, assurance, observation, context):
    return assurance.chosen(observation, scores(observation, context))
