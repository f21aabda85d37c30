"""Policies that try to break the limits: what an assurance is tried with."""

import chex
import jax
import jax.numpy as jnp
import numpy as np

from attjax import dynamics
from attjax.control.keep_out import Cones
from attjax.dynamics import rigid_body
from attjax.envs import observation as observations
from attjax.envs.context import Context


def fastest(observation: chex.Array, context: Context) -> chex.Array:
    """(actions,) scores: the higher the peak rate after an action, the better.

    Args:
        observation: (11,) Eq. 11.
        context: of the loop.
    """
    return rigid_body.peak_rate(_after(observation, context), context.inertia)


def hesitating(observation: chex.Array, context: Context) -> chex.Array:
    """(actions,) scores: the largest torques that raise the rate, and else a weaker one against it.

    Where it is not known whether the last torque has come yet, a small one against the rate that is
    counted twice makes room for a large one.

    Args:
        observation, context: as of :func:`fastest`.
    """
    rate = observation[observations.ANGULAR_VELOCITY]
    gained = fastest(observation, context) - rigid_body.peak_rate(rate, context.inertia)
    sizes = jnp.linalg.norm(context.torque_table, axis=1)
    is_large = sizes > 0.99 * context.largest_torque
    return jnp.where(is_large == (gained > 0), 1 + jnp.abs(gained), -jnp.abs(gained))


def into_cones(cones: Cones, observation: chex.Array, context: Context) -> chex.Array:
    """(actions,) scores: the faster an action turns the nearest axis into its cone, the better.

    Args:
        cones: that are to be kept out of.
        observation, context: as of :func:`fastest`.
    """
    quaternion = observation[observations.QUATERNION]
    nearest = jnp.argmin(cones.clearance(quaternion))
    axis, seen = cones.axes[nearest], cones.seen(quaternion)[nearest]
    towards = jnp.cross(axis, seen)
    unit = towards / jnp.maximum(jnp.linalg.norm(towards), 1e-6)
    return jnp.sum(unit * _after(observation, context), axis=-1)


def at_random(key: chex.PRNGKey, observation: chex.Array, context: Context) -> chex.Array:
    """(actions,) scores, drawn anew for each observation.

    Args:
        key: of them.
        observation, context: as of :func:`fastest`.
    """
    words = jax.lax.bitcast_convert_type(observation.astype(jnp.float32), jnp.uint32)
    word = jnp.sum(words * np.arange(1, 2 * len(words), 2, dtype=np.uint32))
    key = jax.random.fold_in(key, word)
    return jax.random.uniform(key, (len(context.torque_table),))


def _after(observation, context):
    rate = observation[observations.ANGULAR_VELOCITY]
    inertia, duration = context.inertia, context.torque_duration
    return dynamics.rate_after_impulse(rate, context.torque_table, inertia, duration)
