"""An environment of one's own: what it tells and what it turns differ from the perfect world."""

import dataclasses

import jax
import jax.numpy as jnp

from attjax import AttitudeEnv
from attjax.envs import observation

BIAS = 0.01
"""Of the angular velocity about x that is told, rad/s."""


@dataclasses.dataclass(frozen=True)
class Weak(AttitudeEnv):
    """Torques of half the strength, and a rate that is told with a bias."""

    def step_env(self, key, state, action, params):
        weak = params.replace(torque_table=params.torque_table / 2)
        return super().step_env(key, state, action, weak)

    def observe(self, key, state, params):
        told = super().observe(key, state, params)
        return told.at[observation.ANGULAR_VELOCITY.start].add(BIAS)


def _brake(told, context):
    """Half a newton metre about x, against the rate that is told."""
    rate = told[observation.ANGULAR_VELOCITY][0]
    return jnp.where(rate > 0, 2, jnp.where(rate < 0, 1, 0))


BRAKE = jax.tree_util.Partial(_brake)
