"""Reaction wheels, against Basilisk, DOP853, the balance of momentum, and by hand."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, rotated_inertia
from moving import Motion, MovingOracle
from references import assert_same_attitude, basilisk, quaternions_of
from worlds import EFFECTS, flight, flown, plants, start, world

from attjax import AttitudeEnv, Spacecraft
from attjax.envs import torques

WHEELS = {
    "inertia": 2e-3, "most_torque": 0.03, "dead_band": 0.004, "most_speed": 30.0,
    "coulomb_friction": 5e-4, "viscous_friction": 2e-5, "start_speed": {"uniform": [-20, 20]},
}  # fmt: skip
SKEW = ((0.8, 0.6, 0), (0, 0.8, 0.6), (0.6, 0, 0.8))
STEP = 1 / 240


@pytest.mark.parametrize("held", [False, True])
def test_flies_as_basilisk(x64, held):
    """Sixty commands about axes that are askew: limits of torque and speed, dead band, friction."""
    actions, mrp, rates, speeds = np.split(basilisk("wheels", held), [1, 4, 7], axis=1)
    craft = Spacecraft(torque_levels=(0.04, 0.02, 0.002), torque_axes=SKEW, torque_held=held)
    env = AttitudeEnv(20, spacecraft=craft, world=world(actuators={"wheels": WHEELS}))
    state, attitudes = start(env), quaternions_of(mrp)
    state = state.replace(
        quaternion=jnp.asarray(attitudes[0]),
        angular_velocity=jnp.asarray(rates[0]),
        plant=state.plant.replace(wheel_speeds=jnp.asarray(speeds[0])),
    )
    after = flight(env, state, actions[1:, 0].astype(int))
    # 8e-16 and 4e-14 rad/s, and 8e-14 of the attitude, integrated in other variables.
    np.testing.assert_allclose(after.angular_velocity, rates[1:], rtol=0, atol=1e-14)
    np.testing.assert_allclose(after.plant.wheel_speeds, speeds[1:], rtol=0, atol=4e-13)
    assert_same_attitude(after.quaternion, attitudes[1:], 1e-12)


@pytest.mark.parametrize(
    ("effects", "delay", "tolerance"),
    # Disturbances are taken once a step, at its middle: 3e-11 rad/s of the true motion.
    [({}, 0, 1e-11), (EFFECTS["all"], 7, 1e-10)],
    ids=["alone", "disturbed"],
)
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
def test_wheels_and_disturbances_are_as_by_dop853(x64, inertia, held, effects, delay, tolerance):
    """Not of so many wheels as a body has axes, not where they are believed, and late."""
    levels = (0.01, 0.002) if held else (0.5, 0.05)
    rules = {"torque_levels": levels, "torque_axes": (*SKEW, (1, -1, 1)), "torque_held": held}
    craft = Spacecraft(inertia=inertia.tolist(), **rules)
    parts = {"gain": {"uniform": [0.8, 1.2]}, "misalignment_deg": 5, "delay": delay}
    free = {name: WHEELS[name] for name in ("inertia", "coulomb_friction", "viscous_friction")}
    wheels = free | {"start_speed": {"uniform": [10, 20]}}
    described = world(actuators=parts | {"wheels": wheels}, disturbances=effects)
    env = AttitudeEnv(5, spacecraft=craft, world=described)
    state, actions = start(env), [1, 4, 0, 16, 7, 2]
    after = flown(env, state, actions)
    gains = np.linalg.norm(state.plant.actuators.directions, axis=1)
    assert np.ptp(gains) > 0.1
    believed = env.default_params.torque_table[1:9:2] / levels[0]
    cosines = np.sum(believed * np.array(state.plant.wheels.axes), axis=1)
    np.testing.assert_allclose(np.degrees(np.arccos(cosines)), 5, rtol=1e-9)

    def motors(n, speeds):
        turn, late = divmod(n - delay, 6)
        number = actions[turn] - 1 if turn >= 0 and (held or late == 0) else -1
        level, rest = divmod(number, 8)
        sign = 1 if rest % 2 else -1
        amount = sign * levels[level] * gains if number >= 0 else np.zeros(4)
        return np.where(np.arange(4) == rest // 2, amount, 0)

    expected = MovingOracle(state.plant).fly(Motion.of(state), motors, 6 * len(actions))
    for found, value in zip(Motion.of(after), expected):
        np.testing.assert_allclose(found, value, rtol=0, atol=tolerance)


def test_momentum_is_conserved_in_the_targets_frame(x64):
    """Whatever motors and friction do, they are aboard; coasting, with and without friction."""
    actuators = {"wheels": WHEELS, "misalignment_deg": 10}
    env = AttitudeEnv(20, world=world(actuators=actuators))
    state = start(env)
    oracle = MovingOracle(state.plant)
    before = oracle.momentum(Motion.of(state))
    smooth = state.plant.wheels._replace(coulomb=jnp.array(0.0), viscous=jnp.array(0.0))
    for beginning, actions in (
        (state, [1, 4, 7, 10, 5, 2, 16, 0] * 5),
        (state, [0] * 40),
        (state.replace(plant=state.plant.replace(wheels=smooth)), [0] * 40),
    ):
        after = flown(env, beginning, actions)
        assert np.abs(after.angular_velocity - state.angular_velocity).max() > 0.1
        momentum = oracle.momentum(Motion.of(after))
        np.testing.assert_allclose(momentum, before, rtol=0, atol=1e-12)


BALL = Spacecraft(inertia=(2, 2, 2), torque_levels=(0.01, 0.001), torque_held=True)


@functools.cache
def by_hand():
    """A still ball with wheels at rest, free of limits and friction, and its compiled step."""
    env = AttitudeEnv(5, spacecraft=BALL, world=world(actuators={"wheels": WHEELS}))
    state = env.reset(jax.random.key(0), env.default_params)[1]
    step = jax.jit(lambda state, action: env.step_env(jax.random.key(0), state, action, params))
    params = env.default_params
    return state.replace(angular_velocity=jnp.zeros(3)), step


def spun(actions, speed=0.0, motors=None, **numbers):
    """Speed of the first wheel and the ball's rate about its axis after each agent step."""
    state, step = by_hand()
    plant = state.plant
    free = {"most_speed": 1e9, "coulomb": 0.0, "viscous": 0.0} | numbers
    limits = {"most_torque": 1e9, "dead_band": 0.0} | (motors or {})
    wheels = plant.wheels._replace(**{x: jnp.array(free[x]) for x in free})
    motor = plant.actuators.motors._replace(**{x: jnp.array(limits[x]) for x in limits})
    speeds = jnp.array([speed, 0.0, 0.0])
    changes = {"wheels": wheels, "actuators": plant.actuators.replace(motors=motor)}
    state, found = state.replace(plant=plant.replace(wheel_speeds=speeds, **changes)), []
    for action in actions:
        state = step(state, action)[1]
        found.append([state.plant.wheel_speeds[0], state.angular_velocity[0]])
    return np.array(found).T


WHEEL, ALL = 2e-3, 2.0  # kg m²
QUICKER = 1 / WHEEL + 1 / (ALL - WHEEL)
"""Rad/s² of a wheel's speed against the body, of 1 N m on it: the body turns the other way."""


@pytest.fixture(autouse=True)
def anew():
    yield
    by_hand.cache_clear()


def test_a_motor_pushes_the_body_by_as_much_as_commanded(x64):
    speed, rate = spun([1, 1, 2, 2, 2])
    impulse = 0.01 * 6 * STEP * np.array([1, 2, 1, 0, -1])
    np.testing.assert_allclose(speed, -impulse * QUICKER, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rate, impulse / (ALL - WHEEL), rtol=0, atol=1e-14)


def test_a_motor_has_a_most_torque_and_a_dead_band(x64):
    limits = {"most_torque": 0.004, "dead_band": 0.003}
    speed, _ = spun([2, 8, 1], motors=limits)  # 0.01, 0.001 and −0.01 N m of the motor
    expected = 0.004 * 6 * STEP * QUICKER * np.array([1, 1, 0])
    np.testing.assert_allclose(speed, expected, rtol=0, atol=1e-12)


def test_a_saturated_wheel_only_slows_down(x64):
    a_step = 0.01 * STEP * QUICKER
    for sign, faster, slower in ((1, 2, 1), (-1, 1, 2)):
        speed, rate = spun([faster] * 6 + [slower], most_speed=0.5)
        assert 0.5 <= sign * speed[5] < 0.5 + a_step and speed[4] == speed[5]
        assert rate[4] == rate[5] != rate[6]
        np.testing.assert_allclose(speed[6], speed[5] - sign * 6 * a_step, rtol=0, atol=1e-12)


def test_friction_slows_a_wheel_and_stops_it(x64):
    """Viscous: exponentially. Coulomb's: evenly, and then neither it nor less turns the wheel."""
    speed, _ = spun([0] * 8, speed=5.0, viscous=0.001)
    times = 6 * STEP * np.arange(1, 9)
    np.testing.assert_allclose(speed, 5 * np.exp(-0.001 * QUICKER * times), rtol=0, atol=1e-12)
    for sign in (1, -1):
        speed, rate = spun([0] * 5 + [7, 7, 8, 8, 2], speed=sign * 0.1, coulomb=0.002)
        evenly = sign * (0.1 - 0.002 * QUICKER * times[:3])
        np.testing.assert_allclose(speed[:3], evenly, rtol=0, atol=1e-12)
        np.testing.assert_allclose(speed[4:9], 0, atol=1e-9)
        np.testing.assert_allclose(rate[4:9], sign * 0.1 * WHEEL / ALL, rtol=0, atol=1e-12)
        np.testing.assert_allclose(speed[9], 0.008 * 6 * STEP * QUICKER, rtol=0, atol=1e-9)


def test_speeds_are_drawn_each_by_itself():
    actuators = {"wheels": WHEELS | {"inertia": {"uniform": [1e-3, 2e-3]}}}
    drawn = plants(AttitudeEnv(5, world=world(actuators=actuators)))
    speeds = np.asarray(drawn.wheel_speeds)
    assert speeds.min() >= -20 and speeds.max() <= 20 and np.abs(speeds.mean(axis=0)).max() < 0.8
    assert np.abs(np.corrcoef(speeds.T)[np.triu_indices(3, 1)]).max() < 0.06
    assert np.ptp(drawn.wheels.inertia) > 0.9e-3


def test_what_a_command_loses_it_loses_before_the_motor():
    """Faulty and weak axes; what is told of the torque is of the motors."""
    actuators = {"wheels": {"inertia": 1e-3, "most_torque": 0.3}, "faulty_axes": [2]}
    env = AttitudeEnv(5, world=world(actuators=actuators | {"gain": 0.5, "fault_gain": 0.1}))
    state, params = env.reset(jax.random.key(0), env.default_params)[1], env.default_params
    for action, expected in ((1, [0.25, 0, 0]), (4, [0, -0.025, 0])):
        found = torques.acting_torque(state, action, params, 5)
        np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_continuous_actions_have_wheels_about_the_bodys_axes():
    env = AttitudeEnv(5, actions="continuous", world=world(actuators={"wheels": {"inertia": 1e-3}}))
    state = env.reset(jax.random.key(0), env.default_params)[1]
    action, still = jnp.array([0.2, -0.4, 1.0]), state.replace(angular_velocity=jnp.zeros(3))
    after = env.step_env(jax.random.key(0), still, action, env.default_params)[1]
    push = np.array([0.2, -0.4, 1.0]) * 0.5 * STEP
    np.testing.assert_allclose(after.angular_velocity, push / (LM50 - 1e-3), rtol=2e-3)
    momentum = LM50 * after.angular_velocity + 1e-3 * after.plant.wheel_speeds
    np.testing.assert_allclose(momentum, 0, atol=1e-6)
