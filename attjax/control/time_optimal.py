"""How long a slew must take."""

import chex
import jax.numpy as jnp

from attjax.control.classical import average_torque
from attjax.dynamics import numerics, rigid_body
from attjax.dynamics import quaternion as quaternions
from attjax.envs.context import Context


def time_optimal_reference(quaternion: chex.Array, context: Context) -> chex.Array:
    """Rest-to-rest time of a (4,) slew with decoupled axes, T = 2 √(Σ|θᵢ|Iᵢ/U), s.

    U is the largest torque averaged over a control period. An estimate and no bound: turning
    about other axes than the eigenaxis can be about a tenth quicker.
    """
    angle = context.integral_of_rate(quaternions.rotation_vector(quaternion))
    momentum = jnp.abs(rigid_body.angular_momentum(context.inertia, angle))
    return 2 * numerics.square_root(jnp.sum(momentum) / average_torque(context))
