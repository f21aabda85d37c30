"""What keeps a spacecraft within its limits whatever a policy has learned: the rate mask."""

import chex
import jax.numpy as jnp
from flax import struct

from attjax import dynamics
from attjax.dynamics import rigid_body
from attjax.dynamics.numerics import matmul, square_root
from attjax.envs.context import Context


@struct.dataclass
class RateMask:
    """What the mask needs of a spacecraft, whatever its state; JAX, ONNX and C all use these.

    With g = A ω, the square of the peak rate after action a is at most ω·g + gain_a, where
    gain_a = 2 Δω_a·g + own_gain_a. An action is allowed if that is at most ``limit_squared``,
    or if gain_a < 0, or if it has no torque.

    Attributes:
        form: (3, 3) A of :func:`attjax.dynamics.rigid_body.peak_rate_form`, dimensionless.
        impulse: (actions, 3) Δω_a, change of the rate by each action, rad/s.
        own_gain: (actions,) Δω_a·A Δω_a and a bound of what is not of first order, rad²/s².
        limit_squared: (actions,) rad²/s².
        torque_table: (actions, 3) N m.
    """

    form: chex.Array
    impulse: chex.Array
    own_gain: chex.Array
    limit_squared: chex.Array
    torque_table: chex.Array

    @property
    def coasts(self) -> chex.Array:
        """(actions,) bool, the actions without torque."""
        return coasts(self.torque_table)

    def allowed(self, angular_velocity: chex.Array) -> chex.Array:
        """Which actions keep the spacecraft below the rate limit for good.

        An action is allowed if in the motion that it leads to, its own torque and all coasting
        after it, the rate never passes the margin times the limit, as far as a forecast of first
        order can tell, nor by an upper bound the middle between that and the limit; or if by that
        bound it lowers the peak of a motion that does. So from rest no sequence of allowed actions
        passes the middle (:func:`rate_mask`). Actions without torque are always allowed, so that
        no state is without one.

        Args:
            angular_velocity: (3,) body frame, rad/s.

        Returns:
            (actions,) bool.
        """
        gradient = matmul(self.form, angular_velocity)
        # The peak's square after the action, less that before: a product for all actions at once.
        gain = 2 * matmul(self.impulse, gradient) + self.own_gain
        peak_squared = jnp.sum(gradient * angular_velocity) + gain
        return self.coasts | (peak_squared <= self.limit_squared) | (gain < 0)


def coasts(torque_table: chex.Array) -> chex.Array:
    """(actions,) bool, which rows of an (actions, 3) torque table have no torque.

    Example:
        >>> coasts(jnp.array([[0.0, 0.0, 0.0], [0.0, -0.1, 0.0]])).tolist()
        [True, False]
    """
    return jnp.all(torque_table == 0, axis=-1)


def rate_mask(context: Context, margin: float) -> RateMask:
    """The mask of a spacecraft that keeps ``margin`` times its rate limit.

    The square of the peak rate, P² = ω·Aω, is constant while the spacecraft coasts. A torque that
    would change the rate of a body at rest by Δω in its time d changes P² by 2 Δω·Aω + Δω·AΔω, if
    ω does not turn in the body meanwhile. As it turns by at most √½ P² a second
    (:func:`attjax.dynamics.rigid_body.peak_rate_form`) and P grows by at most p = √(Δω·AΔω), the
    change is larger by at most √½ d p (P² + ⅔ P p + p²/6). That, for the largest P there may be,
    is part of the own gains; the limits give it back, up to the middle between margin and limit.
    All this is convex in the time, so no bound is passed before the torque ends.

    Example:
        >>> from attjax import AttitudeEnv
        >>> env = AttitudeEnv(frameskip=5)
        >>> mask = rate_mask(env.context(env.default_params), 0.99)
        >>> int(jnp.sum(mask.allowed(jnp.zeros(3)))), int(jnp.sum(mask.allowed(jnp.ones(3))))
        (19, 10)
    """
    form = rigid_body.peak_rate_form(context.inertia)
    at_rest = jnp.zeros(3, context.inertia.dtype)
    duration = context.torque_duration
    impulse = dynamics.rate_after_impulse(at_rest, context.torque_table, context.inertia, duration)
    squared = jnp.sum(matmul(impulse, form) * impulse, axis=-1)
    growth = square_root(squared)
    kept, highest = margin * context.rate_limit, (1 + margin) / 2 * context.rate_limit
    turning = rigid_body.MOST_TURNING * duration * growth
    turning = turning * (highest**2 + 2 / 3 * highest * growth + squared / 6)
    allowed = kept**2 + jnp.minimum(turning, highest**2 - kept**2)
    return RateMask(form, impulse, squared + turning, allowed, context.torque_table)
