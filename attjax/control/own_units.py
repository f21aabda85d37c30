"""A spacecraft in units of its own, in which near the goal all spacecraft are the same.

Let aⱼ be the directions of three torque axes, J the largest impulse about one of them and h the
control period. With Iω = J Σ pⱼ aⱼ, the largest impulse adds 1 to one pⱼ, whatever the inertia and
the axes. With I θ = J h Σ yⱼ aⱼ, where θ is the turn to the goal, near it y grows by p in a period.
Torques that last for d move it by p d/2h less; z = y + p d/2h grows as if they came at once.

Spacecraft that differ in the names of their axes alone are the same, too: the axes are put into an
order, by the momentum that a turn about each takes, and so are the torques; and so are states that
differ in which way is called forward about an axis.
"""

from typing import NamedTuple

import chex
import jax.numpy as jnp

from attjax.control.torque_order import axes_and_levels
from attjax.control.triad import reciprocal, tensor, times, volume
from attjax.dynamics.numerics import matmul
from attjax.envs.context import Context


class OwnUnits(NamedTuple):
    """What a spacecraft's own units are made of.

    Attributes:
        momentum: (3, 3) p = momentum ω, 1/(rad/s).
        directions: (3, 3) unit vectors of the torque axes, a row each, body frame.
        shape: (3, 3) symmetric: p of a turn of 1 rad/s about each axis of the reciprocal basis,
            which are the torque axes where these are at right angles.
        levels: (2,) second and third level of torque as shares of the first.
        period, duration: of control and of a torque, s.
        rate_limit: rad/s.
        push: (3,) that a torque that always acts adds to p in a period.
        is_crippled: whether the last axis is dead; its direction is then across both others.
    """

    momentum: chex.Array
    directions: chex.Array
    shape: chex.Array
    levels: chex.Array
    period: chex.Numeric
    duration: chex.Numeric
    rate_limit: chex.Array
    push: chex.Array
    is_crippled: chex.Array

    @property
    def hand(self) -> chex.Array:
        """1 where the axes are right-handed, else -1."""
        return jnp.where(volume(self.directions) < 0, -1, 1)

    @classmethod
    def of(cls, context: Context) -> "OwnUnits":
        """The units of a spacecraft with ACTIONS torques in the order of Table 1.

        Example:
            >>> from attjax import AttitudeEnv
            >>> env = AttitudeEnv(frameskip=5)
            >>> units = OwnUnits.of(env.context(env.default_params))
            >>> round(float(0.5 / 240 / 0.872 * units.momentum[0, 0]), 6)   # the largest pulse
            1.0
        """
        directions, levels, dead = axes_and_levels(context.torque_table)
        onto_axes = reciprocal(directions)
        impulse = levels[0] * context.torque_duration
        momentum = matmul(onto_axes, tensor(context.inertia)) / impulse
        torque = context.disturbance
        torque = jnp.zeros_like(impulse, shape=3) if torque is None else torque
        return cls(
            momentum=momentum,
            directions=directions,
            shape=matmul(momentum, onto_axes.T),
            levels=levels[1:] / levels[0],
            period=context.control_period,
            duration=context.torque_duration,
            rate_limit=context.rate_limit,
            push=context.control_period / impulse * times(onto_axes, torque),
            is_crippled=jnp.any(dead),
        )
