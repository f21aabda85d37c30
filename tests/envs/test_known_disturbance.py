"""A torque that always acts and is known: what it does, and what is shown of the rate."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.own_units import TENSOR

from attjax import AttitudeEnv, EnvState, Spacecraft, step
from attjax.dynamics.disturbances import Disturbances
from attjax.envs import observation as observations
from attjax.envs import parameters
from attjax.envs.leaning import leaned
from attjax.world import Disturbances as Described
from attjax.world import World

TORQUE = np.array([1e-3, -2e-3, 3e-3])
HELD = dataclasses.replace(Spacecraft(inertia=TENSOR), torque_held=True)


@pytest.mark.parametrize("craft", [Spacecraft(), HELD], ids=["principal, pulses", "tensor, held"])
def test_it_does_what_a_worlds_constant_torque_does(x64, craft):
    """The same motion, by equations of their own."""
    env = AttitudeEnv(5, spacecraft=craft)
    world = AttitudeEnv(5, spacecraft=craft, world=World(disturbances=Described(constant_torque=1)))
    _, state = env.reset(jax.random.key(0), env.default_params)
    _, other = world.reset(jax.random.key(0), env.default_params)
    acting = Disturbances(constant=tuple(jnp.asarray(TORQUE, float)))
    other = other.replace(plant=other.plant.replace(disturbances=acting))
    pushed = env.default_params.replace(disturbance=jnp.asarray(TORQUE, float))
    for action in (3, 0, 0, 8, 0, 13):
        state = step(state, action, pushed, 5)
        other = step(other, action, env.default_params, 5)
    np.testing.assert_allclose(state.quaternion, other.quaternion, atol=1e-12)
    np.testing.assert_allclose(state.angular_velocity, other.angular_velocity, atol=1e-12)
    assert np.linalg.norm(state.angular_velocity - step(state, 0, None, 5).angular_velocity) > 0


def test_from_rest_it_is_turned_at_constant_acceleration(x64):
    env = AttitudeEnv(20)
    params = env.default_params.replace(disturbance=jnp.array([0.0, 1e-3, 0.0]))
    state = EnvState(jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3), 0)
    for _ in range(40):
        state = step(state, 0, params, 20)
    time, acceleration = 40 * 21 / 240, 1e-3 / float(params.inertia[1])
    np.testing.assert_allclose(state.angular_velocity, [0, acceleration * time, 0], atol=1e-13)
    angle = 2 * np.arcsin(state.quaternion[1])
    np.testing.assert_allclose(angle, acceleration * time**2 / 2, rtol=1e-9)


def test_it_is_leaned_against():
    """Shown N d T, a controller asks for −d T; a held one for as much all the time."""
    env = AttitudeEnv(5)
    context = env.context(env.default_params.replace(disturbance=jnp.asarray(TORQUE, float)))
    still = observations.observe(jnp.array([0.0, 0.0, 0.6, 0.8]), jnp.zeros(3))
    for duration, share in ((context.control_period, 1.0), (0.0, 0.5)):
        known = dataclasses.replace(
            context, inertia=jnp.diag(context.inertia), torque_duration=duration
        )
        found = leaned(still, known)
        wanted = share * context.control_period * TORQUE / context.inertia
        np.testing.assert_allclose(found[8:], wanted, rtol=1e-5)
        np.testing.assert_allclose(found, observations.observe(still[:4], found[8:]))
    nothing = dataclasses.replace(context, disturbance=None)
    np.testing.assert_array_equal(leaned(still, nothing), still)


def test_an_environment_shows_what_leans_against_it():
    env = AttitudeEnv(5)
    params = env.default_params.replace(disturbance=jnp.asarray(TORQUE, float))
    shown, state = env.reset(jax.random.key(0), params)
    bare, _ = env.reset(jax.random.key(0), env.default_params)
    np.testing.assert_array_equal(shown, leaned(bare, env.context(params)))
    assert np.all(shown[8:] != bare[8:])
    later, *_ = env.step_env(jax.random.key(1), state, 0, params)
    following = step(state, 0, params, 5)
    told = observations.observe(following.quaternion, following.angular_velocity)
    np.testing.assert_allclose(later, leaned(told, env.context(params)), atol=1e-7)


def test_of_a_fleet_each_has_its_own():
    params = parameters.default_params().replace(disturbance=jnp.ones((4, 3)))
    assert parameters.fleet_axes(params).disturbance == 0
    alone = parameters.of_fleet(params, 1)
    assert alone.disturbance.shape == (3,) and parameters.fleet_axes(alone).disturbance is None


def test_what_is_wrong_is_said():
    env = AttitudeEnv(5, world=World(disturbances=Described(constant_torque=0.001)))
    params = env.default_params.replace(disturbance=jnp.asarray(TORQUE, float))
    _, state = env.reset(jax.random.key(0), env.default_params)
    with pytest.raises(ValueError, match=r"params.disturbance is for the ideal world"):
        step(state, 0, params, 5)
    with pytest.raises(ValueError, match=r"disturbance has shape \(2,\)"):
        step(state.replace(plant=None), 0, params.replace(disturbance=jnp.ones(2)), 5)
