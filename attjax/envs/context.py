"""What a controller knows of the spacecraft it steers, beside the observation."""

import chex
import jax.numpy as jnp
from flax import struct

from attjax.spacecraft import INTEGRATION_STEP


@struct.dataclass
class Context:
    """Constants of a closed loop, given to every policy and controller.

    Attributes:
        control_period: time between two actions, s.
        inertia: (3,) principal moments or (3, 3) tensor, body frame, kg m².
        torque_table: (actions, 3) torque of each action, body frame, N m.
        rate_limit: largest admissible ‖ω‖, rad/s.
        torque_duration: how long a torque acts, from the beginning of a control period, s.
        kinematic_factor: of the kinematics, ½ by Eq. 9; a Python float.
        continuous: whether an action is (3,) fractions of the largest torque about each body axis
            instead of a row of the table; a Python bool.
    """

    control_period: chex.Array
    inertia: chex.Array
    torque_table: chex.Array
    rate_limit: chex.Array
    torque_duration: chex.Numeric = INTEGRATION_STEP
    kinematic_factor: float = struct.field(pytree_node=False, default=0.5)
    continuous: bool = struct.field(pytree_node=False, default=False)

    @property
    def largest_torque(self) -> chex.Array:
        """The largest magnitude in the torque table, N m."""
        return jnp.sqrt(jnp.max(jnp.sum(self.torque_table**2, axis=-1)))

    def integral_of_rate(self, angle: chex.Numeric) -> chex.Numeric:
        """∫ω dt, rad, of a turn by ``angle`` about a fixed axis: by Eq. 9 the angle itself."""
        factor = self.kinematic_factor
        return angle if factor == 0.5 else angle / (2 * factor)
