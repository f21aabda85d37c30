"""Worlds that tests describe, and flights in them."""

import jax
import jax.numpy as jnp
from bodies import random_spacecraft

from attjax.world import World

ORBIT = {"altitude_km": 500, "inclination_deg": 50}
EFFECTS = {
    "gravity gradient": {"gravity_gradient": True},
    "dipole": {"residual_dipole": 0.5},
    "drag": {"drag": {"area": 0.2, "lever_arm": 1, "density": 1e-12}},
    "radiation": {"radiation_pressure": {"area": 2, "lever_arm": 1}},
    "constant": {"constant_torque": 0.02},
    "sinusoid": {"sinusoid": {"torque": 0.02, "period": 3}},
}
EFFECTS["all"] = {
    name: value for effect in list(EFFECTS.values()) for name, value in effect.items()
}


def world(**tables):
    return World.from_lists({"name": "test", "orbit": ORBIT, **tables})


def start(env, seed=3):
    """A state at the beginning of an episode that is turning already."""
    state = env.reset(jax.random.key(seed), env.default_params)[1]
    quaternion, rate, _ = (x[seed] for x in random_spacecraft(seed + 1))
    return state.replace(quaternion=quaternion, angular_velocity=rate)


def flown(env, state, actions):
    step = jax.jit(lambda state, action: env.step_env(jax.random.key(0), state, action, params))
    params = env.default_params
    for action in actions:
        state = step(state, jnp.asarray(action))[1]
    return state


def flight(env, state, actions):
    """States after each of the actions."""

    def step(state, action):
        after = env.step_env(jax.random.key(0), state, action, env.default_params)[1]
        return after, after

    return jax.jit(lambda state, actions: jax.lax.scan(step, state, actions)[1])(
        state, jnp.asarray(actions)
    )


def plants(env, count=4000):
    keys = jax.random.split(jax.random.key(5), count)
    return jax.jit(jax.vmap(lambda key: env.reset(key, env.default_params)[1].plant))(keys)
