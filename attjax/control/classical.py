"""Classical controllers on the same torques, with the signature of a policy.

``act(observation (11,), context) -> action``. Both ask for an angular velocity and take the
action whose impulse comes nearest to the one that leads there; where ``context.continuous``, that
impulse itself, as far as the torques can give it.
"""

from collections.abc import Callable
from typing import NamedTuple

import chex
import jax.numpy as jnp

from attjax import checks
from attjax.control import torque_order, triad
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics import rigid_body
from attjax.dynamics.numerics import squared_norm
from attjax.envs import observation as observations
from attjax.envs import torques
from attjax.envs.context import Context


class Gains(NamedTuple):
    """Of both laws.

    Attributes:
        braking_margin: η, the share of the available deceleration that the braking curve counts on.
        terminal_gain: share of the remaining angle that the phase-plane controller covers in a
            control period.
        bandwidth: of the quaternion feedback, in units of the slowest braking rate (see there).
        rate_margin: largest wanted rate, as a share of the rate limit.
    """

    braking_margin: chex.Numeric = 0.75
    terminal_gain: chex.Numeric = 0.5
    bandwidth: chex.Numeric = 1.8
    rate_margin: chex.Numeric = 0.9


GAINS = Gains()


def phase_plane(observation: chex.Array, context: Context, gains: Gains = GAINS) -> chex.Array:
    """Follow the braking curve along the rotation to the goal.

    With the impulses shared among the axes so that all arrive together, the angle |θ| that
    remains can be braked from the rate ω = −θ √(2 η U / Σ|I θ|), where U is the largest
    torque averaged over a control period and η the braking margin. Continuous torques brake all
    axes at once, and the one that takes longest rules: max|I θ| in place of the sum. Where torques
    are along other axes, or not all as large, it is what :func:`momentum_to_give` says. Close to
    the goal the rate is limited to a share of θ in each period. (θ is what ω must integrate to;
    by other kinematics than Eq. 9's that is not the angle.)

    Args:
        observation: (11,) Eq. 11.
        context: the spacecraft and its actions.
        gains: of the law.

    Returns:
        The action: an integer scalar, or (3,) fractions where the context says so.
    """
    observation = checks.real("observation", observation, (observations.SIZE,))
    angle = quaternions.rotation_vector(observation[observations.QUATERNION])
    angle = context.integral_of_rate(angle)
    momentum = momentum_to_give(angle, context)
    braking = jnp.sqrt(
        2 * gains.braking_margin * average_torque(context) / jnp.maximum(momentum, 1e-12)
    )
    gain = jnp.minimum(braking, gains.terminal_gain / context.control_period)
    return nearest_action(-gain * angle, observation, context, gains.rate_margin)


def quaternion_feedback(
    observation: chex.Array, context: Context, gains: Gains = GAINS
) -> chex.Array:
    """Quaternion-rate feedback (PD): M = −I (2 λ q_v sign(q_s) + ω) / Δt.

    The derivative gain, one over the control period Δt, takes the rate error out in one
    period; the proportional gain is 2 λ/Δt with the bandwidth λ a fixed multiple of
    √(U / (π I_max)), the braking rate of a half turn about the largest inertia.
    """
    observation = checks.real("observation", observation, (observations.SIZE,))
    quaternion = observation[observations.QUATERNION]
    sign = jnp.where(quaternion[3] < 0, -1.0, 1.0).astype(quaternion.dtype)
    largest = jnp.max(rigid_body.principal_moments(context.inertia))
    half_turn = context.integral_of_rate(jnp.pi)
    bandwidth = gains.bandwidth * jnp.sqrt(average_torque(context) / (half_turn * largest))
    vector = context.integral_of_rate(quaternion[:3])
    wanted = -2 * bandwidth * sign * vector
    return nearest_action(wanted, observation, context, gains.rate_margin)


def average_torque(context: Context) -> chex.Array:
    """Largest torque, averaged over a control period, N m: it may act for a part of it."""
    return context.largest_torque * context.torque_duration / context.control_period


def momentum_to_give(angle: chex.Array, context: Context) -> chex.Array:
    """What :func:`average_torque` must give for a turn by a (3,) angle in a second, N m s.

    Of torques about one axis at a time, Σ|pⱼ| with I θ = Σ pⱼ aⱼ, where aⱼ is the largest about
    each of three axes over the largest of all; where there are not three, up and down, that span a
    space, of the body's. Of continuous ones, which act about all at once, the largest |I θ|, each
    in proportion to the largest torque about its axis.
    """
    momentum = rigid_body.angular_momentum(context.inertia, angle)
    if context.continuous:
        return jnp.max(context.largest_torque * _over(jnp.abs(momentum), context))
    return jnp.sum(jnp.abs(triad.times(triad.reciprocal(_axes(context)), momentum)))


def _axes(context):
    """(3, 3) the a of :func:`momentum_to_give`, a row each."""
    table, count = context.torque_table, torque_order.AXES
    body = jnp.eye(3, dtype=table.dtype)
    if context.torque_axes != count or (len(table) - 1) % (2 * count):
        return body
    axes, _, _ = torque_order.axes_and_levels(table)
    is_of_pairs = jnp.all(table[1::2] == -table[2::2])
    spans_space = jnp.abs(triad.volume(axes)) > torque_order.FLATTEST
    return jnp.where(is_of_pairs & spans_space, axes, body)


def nearest_action(
    wanted_rate: chex.Array,
    observation: chex.Array,
    context: Context,
    rate_margin: chex.Numeric = GAINS.rate_margin,
) -> chex.Array:
    """The action whose impulse is nearest to I (wanted rate − ω), for a (3,) wanted rate.

    The wanted rate is first scaled back to within the margin of the rate limit. Of continuous
    actions it is that impulse, about each axis as far as the torque can give it.
    """
    rate = jnp.sqrt(squared_norm(wanted_rate))
    scale = jnp.minimum(1.0, rate_margin * context.rate_limit / jnp.maximum(rate, 1e-12))
    change = wanted_rate * scale - observation[observations.ANGULAR_VELOCITY]
    impulse = rigid_body.angular_momentum(context.inertia, change)
    if context.continuous:
        return jnp.clip(_over(impulse / context.torque_duration, context), -1, 1)
    missing = context.torque_table * context.torque_duration - impulse
    return jnp.argmin(jnp.sum(missing**2, axis=-1))


def _over(vector, context):
    """A (3,) vector over the largest torque about each axis; 0 where there is none."""
    largest = torques.largest_torques(context.torque_table)
    return jnp.where(largest > 0, vector / jnp.where(largest > 0, largest, 1), 0)


CONTROLLERS: dict[str, Callable[[chex.Array, Context], chex.Array]] = {
    "phase-plane": phase_plane,
    "feedback": quaternion_feedback,
}
"""Controllers by the names that ``eval.py --controller`` knows."""
