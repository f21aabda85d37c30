"""How long a slew must take."""

import chex
import jax.numpy as jnp

from attjax.control.classical import average_torque, momentum_to_give
from attjax.dynamics import numerics
from attjax.dynamics import quaternion as quaternions
from attjax.envs.context import Context


def time_optimal_reference(quaternion: chex.Array, context: Context) -> chex.Array:
    """Rest-to-rest time of a (4,) slew with decoupled axes, T = 2 √(Σ|θᵢ|Iᵢ/U), s.

    U is the largest torque averaged over a control period; where torques are along other axes, or
    not all as large, the sum is :func:`momentum_to_give`. An estimate and no bound: turning
    about other axes than the eigenaxis can be about a tenth quicker. Continuous torques act about
    all axes at once: the largest |θᵢ|Iᵢ in place of the sum.
    """
    angle = context.integral_of_rate(quaternions.rotation_vector(quaternion))
    return 2 * numerics.square_root(momentum_to_give(angle, context) / average_torque(context))


def rate_limited_reference(quaternion: chex.Array, context: Context) -> chex.Array:
    """The same where the rate limit is kept, about a fixed axis: accelerate, coast at it, brake.

    Example:
        >>> from attjax import AttitudeEnv
        >>> env = AttitudeEnv(frameskip=5)
        >>> context = env.context(env.default_params)
        >>> turned = jnp.array([0.0, 0.7071068, 0.0, 0.7071068])   # 90° about y, in 2.9 s at best
        >>> round(rate_limited_reference(turned, context).item(), 3)
        3.832
    """
    angle = numerics.square_root(numerics.squared_norm(quaternions.rotation_vector(quaternion)))
    angle = context.integral_of_rate(angle)
    free = time_optimal_reference(quaternion, context)
    limit = context.rate_limit
    acceleration = 4 * angle / free**2
    limited = angle / limit + limit / acceleration
    return jnp.where(acceleration * free / 2 > limit, limited, free)
