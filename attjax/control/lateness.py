"""Which delay torques come with, where that is not known beforehand: one of those that can be.

Each of them foretells another motion in each control period. What is believed is the one whose
foretold motion has been the nearest to what was measured, over all decisions so far.
"""

from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np

from attjax.control import belief, covariance, estimator, measured
from attjax.control.linearized import Noise
from attjax.dynamics.actuators import Queue
from attjax.dynamics.sensing import Measurement
from attjax.envs.context import Context
from attjax.envs.knowledge import Knowledge

MOST_DELAYS = 25
"""That are told apart; of more that can be, so many, at even distances."""

MOST_SURPRISE = 25.0
"""χ² of one number that counts at most: one period that nothing foretells decides nothing."""

FIRST = 1e-3
"""χ² by RK4 step from the mean, before anything is measured."""


def delays_of(known: Knowledge) -> np.ndarray:
    """(delays,) that can be, RK4 steps, ascending.

    Example:
        >>> delays_of(Knowledge(delays=(0, 4))).tolist()
        [0, 1, 2, 3, 4]
    """
    assert known.delays is not None
    low, high = known.delays
    return np.rint(np.linspace(low, high, min(high - low + 1, MOST_DELAYS))).astype(int)


def unknowing(context: Context) -> chex.Array:
    """(delays,) surprises before anything is measured: the mean is believed."""
    known = context.knowledge
    return jnp.asarray(FIRST * abs(delays_of(known) - known.delay), context.inertia.dtype)


def believed(surprises: chex.Array, context: Context) -> chex.Array:
    """The delay with the least surprise, RK4 steps, as a number of the inertia's type."""
    delays = jnp.asarray(delays_of(context.knowledge), context.inertia.dtype)
    return delays[jnp.argmin(surprises)]


def delayed(queue: Queue, delay: chex.Numeric) -> Queue:
    """A queue of commands, in which all begin so many RK4 steps after they were given."""
    return queue.later(-delay)


def judged(
    surprises: chex.Array,
    queue: Queue,
    seen: tuple[Any, Any, Measurement, Noise, chex.Numeric],
    last: chex.Array,
    context: Context,
) -> chex.Array:
    """The surprises after a measurement.

    Args:
        surprises: at the decision before.
        queue: of the commands until then, body frame, as given.
        seen: the estimate then; what was expected of the sensors then; what they tell now; their
            noise; and the change of the rate that is of no use, rad/s.
        last: decisions before that one.
        context: as believed then.
    """
    estimate, expected, told, noise, least = seen
    spread = [covariance.at(estimate.covariance, n, n) for n in (3, 4, 5, 0, 1, 2)]
    floor = [least**2] * 3 + [(least * context.control_period) ** 2] * 3

    def surprise(delay):
        motion = belief.one_period(estimate, delayed(queue, delay), last, context)
        foretold = estimate.replace(
            quaternion=motion.quaternion, angular_velocity=motion.angular_velocity
        )
        later = estimator.expected_after(expected, motion, last, context)
        numbers = measured.innovations(foretold, later, told, noise)
        terms = [
            jnp.minimum(x.innovation**2 / (x.variance + s + f), MOST_SURPRISE) * x.is_told
            for x, s, f in zip(numbers, spread, floor)
        ]
        return sum(terms[1:], terms[0])

    delays = jnp.asarray(delays_of(context.knowledge), context.inertia.dtype)
    return surprises + jax.vmap(surprise)(delays)
