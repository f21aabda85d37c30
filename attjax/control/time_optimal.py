"""What slews are compared by: the paper's examples (Table 5), and how long a slew must take."""

import chex
import jax.numpy as jnp

from attjax.control.classical import average_torque
from attjax.dynamics import numerics, rigid_body
from attjax.dynamics import quaternion as quaternions
from attjax.envs.context import Context
from attjax.envs.simulator import EnvState

TABLE_5 = {
    "slew1": (0.44228, 0.44228, 0.44228, 0.64279),
    "slew2": (0.44228, -0.44228, 0.44228, 0.64279),
    "slew3": (-0.44228, -0.44228, 0.44228, 0.64279),
}
"""Initial error quaternions of the paper's three control examples, 100° each."""


def table_5_slews() -> EnvState:
    """States at the start of the slews of TABLE_5, as a batch of 3, at rest."""
    quaternion = jnp.array(list(TABLE_5.values()), float)
    quaternion /= jnp.linalg.norm(quaternion, axis=-1, keepdims=True)
    n = len(quaternion)
    return EnvState(quaternion, jnp.zeros((n, 3)), jnp.zeros(n, jnp.int32))


def time_optimal_reference(quaternion: chex.Array, context: Context) -> chex.Array:
    """Rest-to-rest time of a (4,) slew with decoupled axes, T = 2 √(Σ|θᵢ|Iᵢ/U), s.

    U is the largest torque averaged over a control period. An estimate and no bound: turning
    about other axes than the eigenaxis can be about a tenth quicker.
    """
    angle = quaternions.rotation_vector(quaternion)
    momentum = jnp.abs(rigid_body.angular_momentum(context.inertia, angle))
    return 2 * numerics.square_root(jnp.sum(momentum) / average_torque(context))
