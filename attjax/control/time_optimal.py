"""How long a slew must take."""

import chex

from attjax.control.classical import average_torque, momentum_to_give
from attjax.dynamics import numerics
from attjax.dynamics import quaternion as quaternions
from attjax.envs.context import Context


def time_optimal_reference(quaternion: chex.Array, context: Context) -> chex.Array:
    """Rest-to-rest time of a (4,) slew with decoupled axes, T = 2 √(Σ|θᵢ|Iᵢ/U), s.

    U is the largest torque averaged over a control period. An estimate and no bound: turning
    about other axes than the eigenaxis can be about a tenth quicker. Continuous torques act about
    all axes at once: the largest |θᵢ|Iᵢ in place of the sum.
    """
    angle = context.integral_of_rate(quaternions.rotation_vector(quaternion))
    return 2 * numerics.square_root(momentum_to_give(angle, context) / average_torque(context))
