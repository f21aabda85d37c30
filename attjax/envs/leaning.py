"""What must be shown of the rate for a constant torque to be held against."""

import chex

from attjax.dynamics.propagation import rate_after_impulse
from attjax.envs import observation as observations
from attjax.envs.context import Context


def leaned(observation: chex.Array, context: Context) -> chex.Array:
    """The observation (11,) that a controller must be shown to hold against a constant torque d.

    It takes out what it is shown by impulses at once, and so holds a target where it is shown 0 on
    average. A torque of the duration τ that undoes d in each period T leaves the attitude where it
    is if the rate is N d T (½ − τ/2T) when it begins; shown N d T, it asks for that torque.

    Args:
        observation: (11,) Eq. 11, as it is.
        context: with the ``disturbance`` d; where it is None, nothing changes.
    """
    if context.disturbance is None:
        return observation
    duration = (context.control_period + context.torque_duration) / 2
    rate = observation[observations.ANGULAR_VELOCITY]
    rate = rate_after_impulse(rate, context.disturbance, context.inertia, duration)
    rules = context.kinematic_factor, context.observes_quaternion_rate
    return observations.observe(observation[observations.QUATERNION], rate, *rules)
