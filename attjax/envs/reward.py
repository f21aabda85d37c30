"""Rewards: functions ``reward(transition) -> scalar`` of one agent step.

To bring your own, pass any function of this signature to ``AttitudeEnv(reward=...)``, or name it
in ``train.py --reward module:function``.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float

from attjax.dynamics import quaternion as quaternions
from attjax.dynamics.numerics import square_root, squared_norm
from attjax.envs import way
from attjax.spacecraft import INTEGRATION_STEP

TERMINAL_BONUS = 50.0
OVERSPEED_PENALTY = -50.0
AUTHORS_OVERSPEED_PENALTY = -25.0
TORQUE_PRICE = 0.5
"""Of the largest pulse, in the reward of the authors' continuous environment."""

LARGEST_PULSE = 0.5 * INTEGRATION_STEP
"""Of Table 1, N m s: 0.5 N m for one RK4 step."""

REFERENCE_PERIOD = 0.025
"""Control period to which :func:`logarithmic_reward` is normalised, s (40 Hz)."""


class Transition(NamedTuple):
    """One agent step as a reward sees it.

    Attributes:
        quaternion: (4,) error quaternion before the step, scalar last.
        next_quaternion: (4,) error quaternion after the step.
        next_angular_velocity: (3,) angular velocity after the step, rad/s.
        terminated: the rate limit was exceeded.
        truncated: the time limit was reached, and the rate limit was not exceeded.
        goal_angle: largest φ that counts as pointing, rad.
        control_period: length of the agent step, s.
        impulse: (3,) what the action gives, body frame, N m s: its torque for as long as it acts.
        torque_table: (actions, 3) torque of each action, body frame, N m; None: not told.
    """

    quaternion: Float[Array | np.ndarray, "4"]
    next_quaternion: Float[Array | np.ndarray, "4"]
    next_angular_velocity: Float[Array | np.ndarray, "3"]
    terminated: Bool[ArrayLike, ""]
    truncated: Bool[ArrayLike, ""]
    goal_angle: Float[ArrayLike, ""]
    control_period: Float[ArrayLike, ""]
    impulse: Float[Array | np.ndarray, "3"]
    torque_table: Float[Array | np.ndarray, "actions 3"] | None = None


def scalar_part_increased(
    before: Float[Array | np.ndarray, "4"], after: Float[Array | np.ndarray, "4"]
) -> Bool[Array, ""]:
    """Whether q_s rose from one (4,) quaternion to the next (condition of Eq. 12).

    Within 0.04° of the goal float32 q_s no longer changes, so where both q_s > 0.5 (or
    both < −0.5) the sharper sin²(φ/2) = ‖q_v‖²/‖q‖² is compared instead.
    """
    sine_before, sine_after = (squared_norm(q[:3]) / squared_norm(q) for q in (before, after))
    near_goal = (before[3] > 0.5) & (after[3] > 0.5)
    near_antipode = (before[3] < -0.5) & (after[3] < -0.5)
    return jnp.where(
        near_goal,
        sine_after < sine_before,
        jnp.where(near_antipode, sine_after > sine_before, after[3] > before[3]),
    )


def paper_reward(transition: Transition) -> Float[Array, ""]:
    """Eq. 12 and 13; the last step's reward is replaced by the terminal reward.

    The terminal reward is −50 beyond the rate limit; at the time limit it is +50 within the
    goal angle, else 0.

    Example:
        >>> goal = jnp.array([0.0, 0.0, 0.0, 1.0])
        >>> rest = jnp.zeros(3)
        >>> at_rest = Transition(goal, goal, rest, False, False, 0.00436, 0.0875, rest)
        >>> paper_reward(at_rest).item()
        9.0
    """
    angle = quaternions.error_angle(transition.next_quaternion)
    return _shaped(transition, angle, jnp.exp(-angle / (0.14 * 2 * jnp.pi)))


def _shaped(transition, angle, closeness):
    """Eq. 12 and 13 with what is said there of closeness, and the terminal rewards."""
    inside = angle <= transition.goal_angle
    improved = scalar_part_increased(transition.quaternion, transition.next_quaternion)
    reward = closeness - jnp.where(improved, 0.0, 1.0) + jnp.where(inside, 9.0, 0.0)
    reward = jnp.where(transition.truncated, jnp.where(inside, TERMINAL_BONUS, 0.0), reward)
    return jnp.where(transition.terminated, OVERSPEED_PENALTY, reward)


def logarithmic_reward(transition: Transition) -> Float[Array, ""]:
    """−log10(φ + 1e-6), φ in rad, for each 25 ms: every decade of pointing is worth the same.

    The time limit earns the ordinary reward, to be bootstrapped by the learner; exceeding
    the rate limit earns −50.

    Example:
        >>> goal = jnp.array([0.0, 0.0, 0.0, 1.0])
        >>> rest = jnp.zeros(3)
        >>> at_rest = Transition(goal, goal, rest, False, False, 0.00436, 0.05, rest)
        >>> round(logarithmic_reward(at_rest).item(), 4)
        12.0
    """
    return _logarithmic(transition, quaternions.error_angle(transition.next_quaternion), 1e-6)


def _logarithmic(transition, angle, offset):
    reward = -jnp.log10(angle + offset) * transition.control_period / REFERENCE_PERIOD
    return jnp.where(transition.terminated, OVERSPEED_PENALTY, reward)


def way_reward(transition: Transition) -> Float[Array, ""]:
    """As :func:`logarithmic_reward`, of the angle to turn by where only two axes are left.

    −log10(φ + 1e-6) where none is dead; else −log10(s + 1e-4), with the angle s of
    :func:`attjax.envs.way.angle_to_turn`, so that the way is worth going.

    Example:
        >>> goal = jnp.array([0.0, 0.0, 0.0, 1.0])
        >>> rest, table = jnp.zeros(3), jnp.diag(jnp.array([0.5, 0.5, 0.0]))
        >>> two = Transition(goal, goal, rest, False, False, 0.00436, 0.025, rest, table)
        >>> round(way_reward(two).item(), 3)
        4.0
    """
    table, quaternion = transition.torque_table, transition.next_quaternion
    if table is None:
        raise ValueError("torque_table is None; the reward for the way needs it")
    offset = jnp.where(jnp.any(way.dead_axes(table)), 1e-4, 1e-6)
    return _logarithmic(transition, way.angle_to_turn(quaternion, table), offset)


def binary_reward(transition: Transition) -> Float[Array, ""]:
    """Eq. 12 and 13 without the exponential: 0 where q_s rose, −1 elsewhere, +9 within the goal.

    Our reading of what the paper says of its predecessor [13], whose reward it calls binary and
    extends by the exponential; terminal rewards as in :func:`paper_reward`.

    Example:
        >>> goal = jnp.array([0.0, 0.0, 0.0, 1.0])
        >>> rest = jnp.zeros(3)
        >>> at_rest = Transition(goal, goal, rest, False, False, 0.00436, 0.0875, rest)
        >>> binary_reward(at_rest).item()
        8.0
    """
    return _shaped(transition, quaternions.error_angle(transition.next_quaternion), 0.0)


def authors_reward(transition: Transition) -> Float[Array, ""]:
    """Eq. 12 and 13 as the authors' public code has them: −25 beyond the rate limit.

    Example:
        >>> goal = jnp.array([0.0, 0.0, 0.0, 1.0])
        >>> rest = jnp.zeros(3)
        >>> too_fast = Transition(goal, goal, rest, True, False, 0.00436, 0.0875, rest)
        >>> authors_reward(too_fast).item()
        -25.0
    """
    reward = paper_reward(transition)
    return jnp.where(transition.terminated, AUTHORS_OVERSPEED_PENALTY, reward)


def authors_continuous_reward(transition: Transition) -> Float[Array, ""]:
    """The same with a price on torque, as in the authors' environment of continuous torques.

    It is half of ‖a‖, where a is the pulse in units of 0.5 N m for 1/240 s; the last step, with
    its terminal reward, is free.

    Example:
        >>> goal = jnp.array([0.0, 0.0, 0.0, 1.0])
        >>> rest, pulse = jnp.zeros(3), jnp.array([0.0, -0.5 / 240, 0.0])
        >>> pushed = Transition(goal, goal, rest, False, False, 0.00436, 0.0875, pulse)
        >>> authors_continuous_reward(pushed).item()
        8.5
    """
    price = TORQUE_PRICE / LARGEST_PULSE * square_root(squared_norm(transition.impulse))
    ended = jnp.logical_or(transition.terminated, transition.truncated)
    return authors_reward(transition) - jnp.where(ended, 0.0, price)


REWARDS: dict[str, Callable[[Transition], Float[Array, ""]]] = {
    "paper": paper_reward,
    "logarithmic": logarithmic_reward,
    "way": way_reward,
    "binary": binary_reward,
    "authors": authors_reward,
    "authors-continuous": authors_continuous_reward,
}
"""Rewards by the names that settings and ``gymnasium.make`` know."""
