"""A flexible mode, against DOP853, the coupled system's eigenvalues and the balance of momentum."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, rotated_inertia
from imperfect import tensor, vector
from moving import Motion, MovingOracle
from worlds import EFFECTS, flight, flown, plants, start, world

from attjax import AttitudeEnv, Spacecraft

MODE = {"frequency": 0.6, "damping": 0.02, "participation": 0.25}
WHEELS = {"inertia": 2e-3, "start_speed": {"uniform": [-50, 50]}, "viscous_friction": 1e-5}


@pytest.mark.parametrize("is_with_all", [False, True], ids=["alone", "with all else"])
@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
def test_a_mode_swings_as_by_dop853(x64, inertia, is_with_all):
    """Five agent steps of a slew, with pulses; alone, or with wheels and all that disturbs."""
    craft = Spacecraft(inertia=inertia.tolist(), torque_levels=(0.5, 0.05))
    disturbances = (EFFECTS["all"] if is_with_all else {}) | {"flexible": MODE}
    tables = {"actuators": {"wheels": WHEELS}} if is_with_all else {}
    env = AttitudeEnv(20, spacecraft=craft, world=world(disturbances=disturbances, **tables))
    state, actions = start(env), [1, 4, 0, 11, 6]
    after = flown(env, state, actions)
    table = np.asarray(env.default_params.torque_table)
    pulses = {21 * n: table[action] for n, action in enumerate(actions)}
    oracle = MovingOracle(state.plant)
    count = len(oracle.axes)

    def motors(n, _):
        return -pulses.get(n, np.zeros(3))[:count]

    on = {} if is_with_all else pulses
    expected = oracle.fly(Motion.of(state), motors, 21 * len(actions), pulses=on)
    assert np.abs(expected.mode).max() > 1e-3
    tolerance = 1e-10 if is_with_all else 1e-11  # 4e-11, of the orbit's place, and 1e-12
    for found, value in zip(Motion.of(after), expected):
        np.testing.assert_allclose(found, value, rtol=0, atol=tolerance)


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
@pytest.mark.parametrize("damping", [0.0, 0.03])
def test_frequency_and_damping_are_the_coupled_systems(x64, inertia, damping):
    """So small that it is linear: η of three steps in a row tells both of a swinging body's.

    Undamped, it is Ω/√(1 − δᵀ I⁻¹ δ), more than of the appendage on a body that is held still.
    """
    mode = {"frequency": 1.3, "damping": damping, "participation": 0.3, "axis": [1.0, 2.0, -1.0]}
    craft = Spacecraft(inertia=inertia.tolist())
    env = AttitudeEnv(20, spacecraft=craft, world=world(disturbances={"flexible": mode}))
    state = env.reset(jax.random.key(0), env.default_params)[1]
    at_rest = state.replace(
        angular_velocity=jnp.zeros(3), plant=state.plant.replace(deflection=jnp.array([1e-7, 0]))
    )
    swing = np.asarray(flight(env, at_rest, [0] * 60).plant.deflection[:, 0])
    sides = np.stack([swing[1:-1], -swing[:-2]], axis=1)
    trace, determinant = np.linalg.lstsq(sides, swing[2:], rcond=None)[0]
    found = np.log(np.roots([1, -trace, determinant]).astype(complex)) / (21 / 240)

    delta = 0.3 * np.array([1, 2, -1]) / np.sqrt(6)
    np.testing.assert_allclose(vector(state.plant.flexible.vector), delta, rtol=1e-12)
    clamped = 2 * np.pi * 1.3
    mass = np.block([[tensor(inertia), delta[:, None]], [delta[None], np.eye(1)]])
    forces = np.zeros((4, 5))  # of ω, η, η̇
    forces[3, 3:] = -(clamped**2), -2 * damping * clamped
    system = np.vstack([np.linalg.solve(mass, forces), np.zeros((1, 5))])[[0, 1, 2, 4, 3]]
    system[3, 4] = 1  # the rate of η is η̇
    values = np.linalg.eigvals(system)
    expected = values[np.argmax(values.imag)]
    np.testing.assert_allclose(found[np.argmax(found.imag)], expected, rtol=0, atol=1e-6)
    if damping == 0:
        part = delta @ np.linalg.solve(tensor(inertia), delta)
        assert part > 0.1
        np.testing.assert_allclose(found.imag.max(), clamped / np.sqrt(1 - part), rtol=1e-6)


@pytest.mark.parametrize("has_wheels", [False, True])
def test_momentum_is_conserved_in_the_targets_frame(x64, has_wheels):
    """The mode is damped, and the wheels' motors push; both are aboard."""
    tables = {"actuators": {"wheels": WHEELS}} if has_wheels else {}
    env = AttitudeEnv(20, world=world(disturbances={"flexible": MODE}, **tables))
    state = start(env)
    plant = state.plant.replace(deflection=jnp.array([0.02, -0.05]))
    state = state.replace(plant=plant)
    oracle = MovingOracle(plant)
    after = flown(env, state, [1, 4, 7, 10, 5] * 8 if has_wheels else [0] * 40)
    assert np.abs(after.plant.deflection - plant.deflection).max() > 0.01
    before, later = (oracle.momentum(Motion.of(x)) for x in (state, after))
    np.testing.assert_allclose(later, before, rtol=0, atol=1e-12)


def test_what_is_drawn_is_as_described():
    """The axis is uniform, and the mode is at rest at first."""
    mode = {"frequency": 0.5, "damping": 0.01, "participation": {"uniform": [0.1, 0.2]}}
    drawn = plants(AttitudeEnv(5, world=world(disturbances={"flexible": mode})))
    vectors = np.stack(drawn.flexible.vector, axis=-1)
    sizes = np.linalg.norm(vectors, axis=-1)
    assert sizes.min() >= 0.0999 and sizes.max() <= 0.2001 and np.ptp(sizes) > 0.09
    units = vectors / sizes[:, None]
    np.testing.assert_allclose(units.T @ units / len(units), np.eye(3) / 3, atol=0.03)
    assert not np.any(drawn.deflection)
    np.testing.assert_allclose(drawn.flexible.stiffness, np.pi**2, rtol=1e-6)
    np.testing.assert_allclose(drawn.flexible.damping, 0.02 * np.pi, rtol=1e-6)


def test_derivatives_pass_through(x64):
    """Of the plain scan, against differences of what the loops of a batch give."""
    tables = {"actuators": {"wheels": WHEELS}, "disturbances": {"flexible": MODE}}
    env = AttitudeEnv(2, world=world(**tables))
    state, params = start(env), env.default_params

    def moved(rate):
        turning = state.replace(angular_velocity=rate)
        after = env.step_env(jax.random.key(0), turning, 1, params)[1]
        return jnp.concatenate([after.angular_velocity, after.plant.deflection])

    rate, along, h = state.angular_velocity, jnp.array([0.3, -0.5, 0.8]), 1e-4
    behind, ahead = jax.jit(jax.vmap(moved))(rate + h * jnp.array([[-1.0], [1.0]]) * along)
    derivative = jax.jit(lambda x: jax.jvp(moved, (x,), (along,))[1])(rate)
    np.testing.assert_allclose(derivative, (ahead - behind) / (2 * h), rtol=0, atol=1e-9)
    assert np.abs(derivative).max() > 0.1
