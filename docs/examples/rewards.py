"""A reward and network inputs of one's own, for train.py --reward and --features."""

import jax.numpy as jnp

from attjax.control import features
from attjax.envs import reward

PRICE = 2e4
"""What an N m s costs; in the logarithmic reward, a decade of pointing earns 40 in a second."""


def frugal(transition: reward.Transition):
    """The logarithmic reward, less the price of the impulse that the actuators gave."""
    impulse = jnp.sqrt(jnp.sum(transition.impulse**2))
    return reward.logarithmic_reward(transition) - PRICE * impulse


def with_momentum(observation, context):
    """The multi-scale inputs, and the angular momentum as a share of what the limit allows."""
    angular_velocity = observation[8:11]
    largest = jnp.max(context.inertia) * context.rate_limit
    momentum = context.inertia * angular_velocity / largest
    return jnp.concatenate([features.multiscale_features(observation, context), momentum])
