"""A spacecraft in units of its own, in which near the goal all spacecraft are the same.

Let aⱼ be the directions of three torque axes, J the largest impulse about one of them and h the
control period. With Iω = J Σ pⱼ aⱼ, the largest impulse adds 1 to one pⱼ, whatever the inertia and
the axes. With I θ = J h Σ yⱼ aⱼ, where θ is the turn to the goal, near it y grows by p in a period.
Torques that last for d move it by p d/2h less; z = y + p d/2h grows as if they came at once.
"""

from typing import NamedTuple

import chex
import jax.numpy as jnp

from attjax.envs.context import Context

AXES, LEVELS = 3, 3
ACTIONS = 1 + 2 * LEVELS * AXES
"""Of a spacecraft with so many torque axes and levels."""


class OwnUnits(NamedTuple):
    """What a spacecraft's own units are made of.

    Attributes:
        momentum: (3, 3) p = momentum ω, 1/(rad/s).
        directions: (3, 3) unit vectors of the torque axes, a row each, body frame.
        shape: (3, 3) symmetric, momentum of a turn about the torque axes: pⱼ = Σ shapeⱼₖ ωₖ where
            the axes are at right angles.
        levels: (2,) second and third level of torque as shares of the first.
        period, duration: of control and of a torque, s.
        rate_limit: rad/s.
    """

    momentum: chex.Array
    directions: chex.Array
    shape: chex.Array
    levels: chex.Array
    period: chex.Numeric
    duration: chex.Numeric
    rate_limit: chex.Array

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
        inertia = context.inertia
        tensor = jnp.diag(inertia) if inertia.ndim == 1 else inertia
        strongest = context.torque_table[1 : 1 + 2 * AXES : 2]
        each = jnp.sqrt(jnp.sum(context.torque_table[1 :: 2 * AXES] ** 2, axis=-1))
        directions = strongest / each[0]
        onto_axes = _reciprocal(directions)
        impulse = each[0] * context.torque_duration
        momentum = jnp.matmul(onto_axes, tensor, precision="highest") / impulse
        return cls(
            momentum=momentum,
            directions=directions,
            shape=jnp.matmul(momentum, onto_axes.T, precision="highest"),
            levels=each[1:] / each[0],
            period=context.control_period,
            duration=context.torque_duration,
            rate_limit=context.rate_limit,
        )


def _reciprocal(directions):
    """The matrix whose product with Σ pⱼ aⱼ is p."""
    a, b, c = directions
    rows = jnp.stack([jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)])
    return rows / jnp.sum(a * rows[0])
