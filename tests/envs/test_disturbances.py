"""What disturbs a spacecraft, against independent accounts of each effect."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, rotated_inertia
from imperfect import Oracle, vector
from references import assert_same_attitude, basilisk, quaternions_of
from worlds import EFFECTS, flight, flown, plants, start, world

from attjax import AttitudeEnv, Spacecraft
from attjax.world import World


@pytest.mark.parametrize("effect", EFFECTS)
@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
def test_disturbances_are_those_of_the_textbooks(x64, effect, inertia):
    """Five agent steps of a slew, with pulses; the effect is far more than the tolerance."""
    craft = Spacecraft(inertia=inertia.tolist(), torque_levels=(0.5, 0.05))
    env = AttitudeEnv(20, spacecraft=craft, world=world(disturbances=EFFECTS[effect]))
    state, actions = start(env), [1, 4, 0, 11, 6]
    after = flown(env, state, actions)
    table = np.asarray(env.default_params.torque_table)
    pulses = {21 * n: table[action] for n, action in enumerate(actions)}
    oracle = Oracle(state.plant)
    quaternion, rate = oracle.fly(state.quaternion, state.angular_velocity, pulses, 105)
    np.testing.assert_allclose(after.quaternion, quaternion, rtol=0, atol=1e-10)
    np.testing.assert_allclose(after.angular_velocity, rate, rtol=0, atol=1e-10)
    undisturbed = flown(AttitudeEnv(20, spacecraft=craft), state.replace(plant=None), actions)
    assert np.linalg.norm(after.angular_velocity - undisturbed.angular_velocity) > 1e-7


@pytest.mark.parametrize("body", [0, 1], ids=["diagonal", "full"])
def test_the_gravity_gradient_is_basilisks(x64, body):
    """Ten seconds of a slow turn, of which it changes the rate by 1e-4 rad/s."""
    mrp, rates = np.split(basilisk("gravity", body), 2, axis=1)
    craft = Spacecraft(inertia=(LM50, rotated_inertia())[body].tolist())
    env = AttitudeEnv(5, spacecraft=craft, world=world(disturbances=EFFECTS["gravity gradient"]))
    state = env.reset(jax.random.key(0), env.default_params)[1]
    node, ahead = (0.6, 0.0, 0.8), (0.48, 0.8, -0.36)
    orbit = state.plant.orbit._replace(node=node, ahead=ahead, start=0.0)
    attitudes = quaternions_of(mrp)
    state = state.replace(
        quaternion=jnp.asarray(attitudes[0]),
        angular_velocity=jnp.asarray(rates[0]),
        plant=state.plant.replace(orbit=jax.tree.map(jnp.asarray, orbit)),
    )
    after = flight(env, state, [0] * 400)
    # 7e-14 rad/s, and 6e-13 of the attitude, which the two integrate in other variables.
    np.testing.assert_allclose(after.angular_velocity[7::8], rates[1:], rtol=0, atol=5e-13)
    assert_same_attitude(after.quaternion[7::8], attitudes[1:], 5e-12)


def test_a_batch_and_an_accelerators_form_fly_alike():
    """Single precision, many spacecraft: CPU's loops against the plain scan, and one by one."""
    env = AttitudeEnv(20, world=world(disturbances=EFFECTS["all"], actuators={"delay": 5}))
    params, keys = env.default_params, jax.random.split(jax.random.key(1), 16)

    def fly(key, action):
        return env.step_env(key, env.reset(key, params)[1], action, params)[1]

    actions = jnp.arange(16)
    together = jax.jit(jax.vmap(fly))(keys, actions)
    for n in (0, 7):
        alone = jax.jit(fly)(keys[n], actions[n])
        np.testing.assert_allclose(together.quaternion[n], alone.quaternion, atol=1e-6)
        np.testing.assert_allclose(together.angular_velocity[n], alone.angular_velocity, atol=1e-6)


def test_derivatives_pass_through():
    env = AttitudeEnv(3, world=world(disturbances=EFFECTS["all"]))
    state = start(env)

    def rate(quaternion):
        after = env.step_env(jax.random.key(0), state.replace(quaternion=quaternion), 1, params)
        return after[1].angular_velocity

    params = env.default_params
    forward = jax.jacfwd(rate)(state.quaternion)
    np.testing.assert_allclose(jax.jacrev(rate)(state.quaternion), forward, atol=1e-7)
    assert np.all(np.isfinite(forward)) and np.any(forward)


class Rubbing(NamedTuple):
    strength: jax.Array

    def torque(self, quaternion, angular_velocity):
        return tuple(-self.strength * rate for rate in angular_velocity)


@dataclasses.dataclass(frozen=True)
class Cable:
    strength: float

    def drawn(self, draws):
        return Rubbing(draws.number("cable", self.strength))


def test_a_disturbance_of_ones_own_acts(x64):
    """Against the closed form: about a principal axis, the rate falls exponentially."""
    env = AttitudeEnv(20, world=World(name="cable", own_disturbances=(Cable(0.05),)))
    assert not env.world.is_ideal
    state = env.reset(jax.random.key(0), env.default_params)[1]
    state = state.replace(angular_velocity=jnp.array([0.3, 0.0, 0.0]))
    after = flown(env, state, [0] * 10)
    expected = 0.3 * np.exp(-0.05 / LM50[0] * 10 * 21 / 240)
    np.testing.assert_allclose(after.angular_velocity, [expected, 0, 0], atol=1e-12)


def test_the_earths_field_is_a_tilted_dipoles(x64):
    """Closed form: over the magnetic poles twice that over the equator, as much at each; tilt."""
    env = AttitudeEnv(5, world=world(disturbances={"residual_dipole": 1.0}))
    state = start(env)
    _, earth = state.plant.disturbances.dipole
    pole, first, second = (vector(x) for x in (earth.pole, earth.first, earth.second))
    dipole = pole + first
    np.testing.assert_allclose(np.linalg.norm(dipole), 1)
    np.testing.assert_allclose(np.degrees(np.arccos(np.linalg.norm(pole))), 9.41, atol=1e-6)
    normal = np.cross(vector(state.plant.orbit.node), vector(state.plant.orbit.ahead))
    np.testing.assert_allclose(-pole @ normal / np.linalg.norm(pole), np.cos(np.deg2rad(50)))
    np.testing.assert_allclose(np.cross(first, second) @ pole < 0, True)  # eastwards about north
    still = earth._replace(start=0.0)
    over_pole, over_equator = (
        np.linalg.norm(vector(still.field(tuple(up), 0.0)))
        for up in (dipole, np.cross(dipole, pole) / np.linalg.norm(np.cross(dipole, pole)))
    )
    np.testing.assert_allclose(over_equator, 2.98e-5 * (6371 / 6871) ** 3)
    np.testing.assert_allclose(over_pole, 2 * over_equator)


def test_orbit_keeps_the_target_still():
    """Directions in the target's frame: uniform, and node, flight and normal at right angles."""
    drawn = plants(AttitudeEnv(5, world=world(disturbances={"gravity_gradient": True})), 500)
    node, ahead = (np.stack(x, axis=-1) for x in (drawn.orbit.node, drawn.orbit.ahead))
    np.testing.assert_allclose(np.sum(node * ahead, axis=-1), 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(node, axis=-1), 1, atol=1e-6)
    np.testing.assert_allclose(node.mean(axis=0), 0, atol=0.1)
    radius = 6.871e6
    np.testing.assert_allclose(drawn.orbit.rate, np.sqrt(3.986004418e14 / radius**3), rtol=1e-5)
