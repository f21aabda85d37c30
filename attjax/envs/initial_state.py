"""Where episodes start: the paper's random slews, and practice near the goal."""

import dataclasses

import chex
import jax
import jax.numpy as jnp

from attjax.dynamics import quaternion as quaternions
from attjax.envs.parameters import EnvParams, EnvState


def initial_state(key: chex.PRNGKey, params: EnvParams) -> EnvState:
    """A spacecraft at rest, turned by a uniform angle about a uniformly distributed axis."""
    return _slew(jax.random.uniform(key, (3,), params.inertia.dtype), params)


def _slew(u, params):
    """The slew that three uniform numbers stand for."""
    axis = _direction(u[:2])
    angle = params.min_slew_angle + u[2] * (params.max_slew_angle - params.min_slew_angle)
    return EnvState(
        quaternion=quaternions.from_axis_angle(axis, angle),
        angular_velocity=jnp.zeros_like(axis),
        time=jnp.zeros((), jnp.int32),
    )


@dataclasses.dataclass(frozen=True)
class NearGoalStarts:
    """Initial states for training: some episodes start near the goal, moving, and end soon.

    Angle and rate of those are log-uniform, down to 1e-6 rad and 2.5e-6 rad/s, in random
    directions. So the learner practises the last decades from the first update on, not only
    once it can steer there. They start late in the episode, ``steps`` before the time limit,
    and never at time 0, by which :func:`starts_whole` tells whole episodes.

    Attributes:
        share: of the episodes that start near the goal; the others are as the paper's.
        steps: agent steps that such an episode lasts.
    """

    share: float
    steps: int

    def __call__(self, key: chex.PRNGKey, params: EnvParams) -> EnvState:
        """Draw one; the signature of :func:`initial_state`."""
        u = jax.random.uniform(key, (10,), params.inertia.dtype)
        angle, rate = 10.0 ** (-6 * u[0]), 0.5 * params.rate_limit * 10.0 ** (-5 * u[1])
        near = EnvState(
            quaternion=quaternions.from_axis_angle(_direction(u[2:4]), angle),
            angular_velocity=rate * _direction(u[4:6]),
            time=jnp.maximum(params.max_steps_in_episode - self.steps, 1),  # not whole
        )
        slew = _slew(u[7:], params)
        return jax.tree.map(lambda a, b: jnp.where(u[6] < self.share, a, b), near, slew)


def starts_whole(state: EnvState) -> chex.Array:
    """Whether the episode that begins with this state is one of the task's, of full length.

    The others are practice from the middle of it: near the goal, as of :class:`NearGoalStarts`,
    or cut short. What they come to says nothing of the task.

    Args:
        state: the first of the episode, or a batch of them.

    Returns:
        A bool for each state.

    Example:
        >>> from attjax.envs.parameters import default_params
        >>> start = initial_state(jax.random.key(0), default_params())
        >>> bool(starts_whole(start)), bool(starts_whole(start.replace(time=400)))
        (True, False)
    """
    return jnp.asarray(state.time) == 0


def _direction(u):
    """A uniformly distributed unit vector (3,) from two uniform numbers."""
    cosine, azimuth = 2 * u[0] - 1, 2 * jnp.pi * u[1]
    sine = jnp.sqrt(1 - cosine**2)
    return jnp.stack([sine * jnp.cos(azimuth), sine * jnp.sin(azimuth), cosine])
