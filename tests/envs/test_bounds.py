"""Bounds of what a world leaves open: nothing that it draws is beyond them."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from worlds import plants as drawn_plants
from worlds import world

from attjax import AttitudeEnv, Spacecraft
from attjax.envs.bounds import bounds
from attjax.envs.torque_bounds import high, low, most
from attjax.envs.torques import actuated
from attjax.evaluation.robustness import environment
from attjax.world import Normal, Uniform, World

NAMED = ("cubesat-6u", "stress")
CLOSE = 1 + 1e-5


def bounded(name):
    env = environment(AttitudeEnv(5), World.named(name) if isinstance(name, str) else name)
    return env, bounds(env.world, env.spacecraft, env.context(env.default_params))


@pytest.mark.parametrize("name", NAMED)
def test_no_drawn_inertia_is_beyond(name):
    env, within = bounded(name)
    believed = np.array(env.spacecraft.inertia)
    moments, axes = np.linalg.eigh(np.asarray(drawn_plants(env).inertia, float))
    shares = moments / np.sort(believed)
    assert (
        np.min(shares) >= within.factors[0] / CLOSE and np.max(shares) <= within.factors[1] * CLOSE
    )
    order = np.argsort(believed)
    if np.min(np.diff(np.sort(believed))) > 0.2 * believed.max():  # axes that are told apart
        cosine = np.abs(axes[:, order, np.arange(3)])
        turned = np.arccos(np.minimum(cosine, 1))
        assert 0.8 * within.turned < np.max(turned) <= within.turned + 1e-3


def test_a_mass_that_comes_or_goes_in_mid_flight_is_within():
    changing = {"inertia_factor": 0.9, "change_factor": {"uniform": [0.5, 2]}, "change_time": 3.0}
    env, within = bounded(world(uncertainty=changing))
    assert within.factors == pytest.approx((0.45, 1.8))
    plants = drawn_plants(env, 500)
    after = jax.vmap(lambda plant: plant.inertia_at(3.5))(plants)
    shares = np.asarray(after) / env.spacecraft.inertia
    assert within.factors[0] / CLOSE <= np.min(shares) < 0.47
    assert 1.75 < np.max(shares) <= within.factors[1] * CLOSE


@pytest.mark.parametrize("name", NAMED)
def test_no_drawn_torque_is_beyond(name):
    env, within = bounded(name)
    state = env.reset(jax.random.key(0), env.default_params)[1]
    plants, params = drawn_plants(env, 500), env.default_params
    wheels, duration = env.world.wheels, float(env.context(params).torque_duration)
    act = functools.partial(given, env, state)
    actions = jnp.arange(1, env.num_actions)
    torques = jax.jit(jax.vmap(jax.vmap(act, (0, None)), (None, 0)))(plants, actions)
    for action, torque in zip(actions.tolist(), np.asarray(torques, float)):
        believed = np.asarray(params.torque_table[action], float)
        length, size = np.linalg.norm(torque, axis=1), np.linalg.norm(believed)
        off = within.offset[action] / duration
        least, largest = within.share[:, action]
        assert np.all(length <= (largest * size + off) * CLOSE)
        assert np.all(length >= (least * size - off) / CLOSE)
        tilt = np.arccos(np.minimum(torque @ believed / (length * size), 1))
        assert np.max(tilt) <= within.tilt + off / (least * size) + 1e-3
        assert wheels or np.max(tilt) > 0.7 * within.tilt


def given(env, state, plant, action):
    torque = actuated(state.replace(plant=plant), action, env.default_params, env.frameskip)
    if plant.wheels is not None:
        torque = jnp.stack(plant.wheels.along_axes(torque))
    return torque


@pytest.mark.parametrize("name", NAMED)
def test_no_drawn_disturbance_is_beyond(name):
    env, within = bounded(name)

    def acting(plant, quaternion):
        torque = plant.disturbances.during(plant.orbit, 10.0).torque(tuple(quaternion))
        swinging = plant.disturbances.swinging
        size = jnp.sqrt(sum(x * x for x in torque))
        return size + (0 if swinging is None else jnp.sqrt(sum(x * x for x in swinging[0])))

    plants = drawn_plants(env, 2000)
    quaternion = jax.random.normal(jax.random.key(1), (2000, 4))
    quaternion /= jnp.linalg.norm(quaternion, axis=1, keepdims=True)
    torques = jax.jit(jax.vmap(acting))(plants, quaternion)
    assert np.max(torques) <= within.disturbance
    assert env.world.wheels or np.max(torques) > 0.1 * within.disturbance
    if env.world.wheels:
        assert within.disturbance > 3**0.5 * 5e-5  # friction of three wheels, on top


def test_of_commands_that_may_do_nothing():
    """Too small an impulse, a dead level, an axis that fails: they count as any from nothing on."""
    _, small = bounded(world(actuators={"minimum_impulse": 1e-4}))
    assert small.share[0][1:].tolist() == [1] * 12 + [0] * 6
    _, dead = bounded(world(actuators={"dead_levels": [2]}))
    assert dead.share[0].tolist() == [1] * 7 + [0] * 6 + [1] * 6
    _, failing = bounded(world(actuators={"faulty_axes": [1], "fault_gain": 0.5, "gain": 1.2}))
    assert failing.share[:, 1].tolist() == pytest.approx([0.6, 1.2])
    assert failing.share[:, 3].tolist() == pytest.approx([1.2, 1.2])
    _, coarse = bounded(world(actuators={"on_time_granularity": 1e-4}))
    assert (
        coarse.offset[1:].tolist() == pytest.approx([0.5 * 1e-4 / 2] * 18) and coarse.offset[0] == 0
    )


def test_of_delays_and_of_distributions_without_end():
    _, late = bounded(world(actuators={"delay": {"uniform": [2, 6]}}))
    assert late.late == 2
    # At 6 RK4 steps a period: one command of those that are a period old, or none, or two.
    delays = {(0, 5): 0, (2, 6): 1, (4, 8): 1, (6, 11): 0, (0, 12): 1, (0, 20): 2}
    for (least, largest), uncounted in delays.items():
        _, late = bounded(world(actuators={"delay": {"uniform": [least, largest]}}))
        assert late.uncounted == uncounted
    _, late = bounded(world(actuators={"delay": 5, "delay_jitter": {"uniform": [0, 2]}}))
    assert late.uncounted == 1
    _, ideal = bounded(World())
    assert ideal.disturbance == ideal.late == ideal.rate == ideal.turned == ideal.uncounted == 0
    assert np.all(ideal.share == 1) and np.all(ideal.offset == 0)
    assert low(Normal(1.0, 0.1)) == pytest.approx(0.5) and high(Normal(1.0, 0.1)) == 1.5
    assert most(Uniform(-3, 2)) == 3 and most(0.5) == 0.5


def test_wheels_store_and_start():
    env, within = bounded("cubesat-6u")
    wheels = within.wheels
    assert wheels.stored == pytest.approx(2.4e-5 * 628)
    longest = 3**0.5 + 3 * np.deg2rad(0.5)
    assert wheels.momentum == pytest.approx(2.4e-5 * 100 * longest, rel=0.05)
    plants = drawn_plants(env, 2000)
    speeds = np.asarray(plants.wheel_speeds)
    axes = np.stack([np.stack(x, axis=-1) for x in plants.wheels.axes], axis=1)
    started = np.einsum("nw,nwk->nk", 2.4e-5 * speeds, axes)
    assert np.max(np.linalg.norm(started, axis=1)) <= wheels.momentum
    held = dataclasses.replace(env.spacecraft, duration=10 * env.spacecraft.duration)
    assert (
        bounds(env.world, held, env.context(env.default_params)).wheels.momentum > wheels.momentum
    )


def test_a_held_torque_that_comes_late_is_in_the_next_period():
    craft = Spacecraft(torque_held=True, torque_levels=(0.05,))
    env = AttitudeEnv(5, spacecraft=craft, world=world(actuators={"delay": {"uniform": [0, 2]}}))
    within = bounds(env.world, craft, env.context(env.default_params))
    assert within.late == 1 and within.uncounted == pytest.approx(1 / 6)
    assert within.offset.tolist() == pytest.approx([2 / 240 * 0.05] * 7)
