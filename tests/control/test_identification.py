"""Identification: derivatives, exact where the truth is told, careful where nothing moves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from worlds import world

from attjax import LM50, AttitudeEnv, Spacecraft, flight_loop
from attjax.control import adaptation, belief, linearized, response
from attjax.control.response import PAIRS, Period
from attjax.envs.parameters import measured

TENSOR = ((0.9, 0.02, 0.01), (0.02, 0.5, -0.03), (0.01, -0.03, 0.8))
SKEW = ((1.0, 0.2, 0.0), (0.0, 1.0, 0.3), (0.1, 0.0, 1.0))
CRAFTS = {
    "pulses, principal axes": Spacecraft(),
    "held, full tensor, skew axes": Spacecraft(
        inertia=TENSOR, torque_levels=(0.05, 0.005), torque_axes=SKEW, torque_held=True
    ),
}
WRONG = {
    "moments": {"uncertainty": {"moment_factor": {"uniform": [0.6, 1.4]}}},
    "axes": {"uncertainty": {"axes_turned_deg": 8}},
    "torques": {"actuators": {"gain": {"uniform": [0.9, 1.1]}, "misalignment_deg": 8}},
}


def wandering(observation, context):
    """Any torque, as the state has it: all axes and levels, both ways."""
    bits = jax.lax.bitcast_convert_type(observation.astype(jnp.float32), jnp.uint32)
    return (jnp.sum(bits) >> 3).astype(jnp.int32) % len(context.torque_table)


def flown(env, steps, seed=0, law=wandering):
    """The last memory and state of a flight, and N and strengths after each decision."""
    loop, params = flight_loop(law, adapts=True), env.default_params
    context = env.context(params)

    @jax.jit
    def fly(key):
        state = env.reset(key, params)[1]

        def step(carry, _):
            memory, state = carry
            action, memory = loop.step(memory, measured(state), context)
            state = env.step_env(key, state, action, params)[1]
            return (memory, state), jnp.stack(memory.identity.mobility + memory.identity.strengths)

        return jax.lax.scan(step, (loop.init(context), state), None, length=steps)

    (memory, state), path = fly(jax.random.key(seed))
    return memory, state, np.asarray(path)


def true_mobility(state):
    inertia = np.asarray(state.plant.inertia)
    return np.linalg.inv(np.diag(inertia) if inertia.ndim == 1 else inertia)


def found_mobility(memory):
    return np.array(response.symmetric(memory.identity.mobility))


def true_columns(state, env):
    actuators = state.plant.actuators
    given = response.torque_directions(env.context(env.default_params))
    directions = given if actuators is None else actuators.directions
    return np.asarray(directions) @ true_mobility(state)


@pytest.mark.parametrize("craft", CRAFTS)
def test_sensitivities_are_the_derivatives_of_the_motion(craft):
    """Of the believed motion, by rate, mobility and columns; also where torques are skew."""
    with jax.enable_x64(True):
        env = AttitudeEnv(5, spacecraft=CRAFTS[craft], world=world())
        context = adaptation.filtering(env.context(env.default_params))
        loop = flight_loop(wandering, adapts=True)
        memory = loop.init(context)
        queue = memory.queue.and_then(0, 0.3 * jnp.eye(response.valves_of(context))[1])
        quaternion = tuple(jnp.array([0.1, -0.2, 0.3, 0.927]))
        axes = len(memory.identity.columns)

        def end(error):
            identity = memory.identity.replace(
                mobility=tuple(x + e for x, e in zip(memory.identity.mobility, error[3:9])),
                columns=tuple(
                    tuple(x + e for x, e in zip(column, error[9 + 3 * a :]))
                    for a, column in enumerate(memory.identity.columns)
                ),
            )
            rate = tuple(jnp.array([0.03, -0.02, 0.025]) + error[:3])
            estimate = memory.estimate.replace(quaternion=quaternion, angular_velocity=rate)
            known = adaptation.believed(context, identity, queue)
            bodily = adaptation.bodily(queue, identity, known)
            motion = belief.one_period(estimate, bodily, jnp.asarray(0), known)
            return jnp.stack(motion.angular_velocity)

        nothing = jnp.zeros(9 + 3 * axes)
        wanted = np.asarray(jax.jacfwd(end)(nothing))
        known = adaptation.believed(context, memory.identity, queue)
        model = linearized.model(adaptation.bodily(queue, memory.identity, known), known)
        durations = jnp.stack(belief.durations(queue, known))
        impulses = tuple(jnp.sum(durations[:, None] * queue.torques, axis=0))
        before, after = tuple(jnp.array([0.03, -0.02, 0.025])), tuple(end(nothing))
        period = Period(before, after, impulses, (0.0,) * 3)
        rows = np.array(response.sensitivities(memory.identity, period, model)[0], float)
    for part in (slice(0, 3), slice(3, 9), slice(9, None)):
        scale = np.abs(wanted[:, part]).max()
        assert scale > 1e-6
        np.testing.assert_allclose(rows[:, part], wanted[:, part], rtol=0, atol=0.03 * scale)


@pytest.mark.parametrize(
    ("wrong", "craft"),
    [
        ("moments", "pulses, principal axes"),
        ("torques", "pulses, principal axes"),
        ("axes", "held, full tensor, skew axes"),
    ],
)
def test_where_the_truth_is_told_it_comes_to_it(wrong, craft):
    """What an impulse does, about each axis; and I as far as it can be told: in proportion."""
    with jax.enable_x64(True):
        env = AttitudeEnv(5, spacecraft=CRAFTS[craft], world=world(**WRONG[wrong]))
        memory, state, _ = flown(env, 300)
        wanted, found = true_columns(state, env), np.array(memory.identity.columns)
        shape, of_shape = found_mobility(memory), true_mobility(state)
    np.testing.assert_allclose(
        found / np.abs(wanted).max(), wanted / np.abs(wanted).max(), atol=1e-3
    )
    np.testing.assert_allclose(
        shape / np.trace(shape), of_shape / np.trace(of_shape), rtol=0, atol=5e-3
    )
    if wrong != "torques":  # and so its size, where the torques are known
        assert np.trace(shape) == pytest.approx(np.trace(of_shape), rel=5e-3)


def test_also_in_single_precision():
    env = AttitudeEnv(5, world=world(uncertainty={"axes_turned_deg": 10}))
    for seed in range(3):
        memory, state, _ = flown(env, 300, seed)
        np.testing.assert_allclose(found_mobility(memory), true_mobility(state), atol=0.01)


def test_a_sudden_change_is_followed_within_a_second():
    """The mass doubles, and an axis loses half: what a pulse does is known 40 decisions later."""
    for changed in (
        {"uncertainty": {"change_factor": 2.0, "change_time": 2.0}},
        {"actuators": {"faulty_axes": [2], "fault_gain": 0.5, "fault_time": 2.0}},
    ):
        env = AttitudeEnv(5, world=world(**changed))
        memory, _, _ = flown(env, 120)
        context = env.context(env.default_params)
        given = adaptation.believed(context, memory.identity, memory.queue)
        found = np.asarray(given.torque_table @ np.linalg.inv(given.inertia))
        wanted = np.asarray(context.torque_table / context.inertia)
        factor = 0.5 if "uncertainty" in changed else np.array([1.0, 0.5, 1.0])
        largest = slice(1, 7)
        np.testing.assert_allclose(found[largest], (factor * wanted)[largest], rtol=0, atol=0.05)


def test_what_is_not_moved_is_not_learned_and_not_forgotten():
    """Coasting at rest tells nothing, however long: neither number nor doubt changes."""
    env = AttitudeEnv(5, world=world(uncertainty={"moment_factor": {"uniform": [0.6, 1.4]}}))
    context = env.context(env.default_params)
    start = flight_loop(wandering, adapts=True).init(context).identity
    memory, _, path = flown(env, 400, law=lambda observation, context: jnp.asarray(0))
    np.testing.assert_array_equal(path, path[:1].repeat(len(path), axis=0))
    root, before = memory.identity.spread.response, start.spread.response
    np.testing.assert_allclose(root @ root.T, before @ before.T, rtol=1e-5, atol=1e-9)


def test_in_a_world_that_is_as_believed_nothing_changes():
    env = AttitudeEnv(5, world=world())
    _, _, path = flown(env, 200)
    np.testing.assert_allclose(path, path[:1].repeat(len(path), axis=0), rtol=1e-6)


def test_wheels_are_refused():
    wheels = {"wheels": {"inertia": 1e-3}}
    env = AttitudeEnv(5, world=world(actuators=wheels))
    with pytest.raises(ValueError, match="cannot adapt to reaction wheels"):
        flight_loop(wandering, adapts=True).init(env.context(env.default_params))


def test_pairs_are_the_elements_of_a_symmetric_matrix():
    rows = response.symmetric(tuple(range(6)))
    assert [rows[i][j] for i, j in PAIRS] == [rows[j][i] for i, j in PAIRS] == list(range(6))


def test_a_bias_of_the_gyro_is_no_change_of_the_spacecraft():
    """All that tells of it is the star tracker: what a pulse changes the rate by stays as it is."""
    env = AttitudeEnv(5, world=world(sensors={"gyro": {"bias_deg_per_h": 200}}))
    memory, _, path = flown(env, 200)
    assert np.abs(np.array(memory.estimate.bias)).max() > 1e-4
    np.testing.assert_allclose(path, path[:1].repeat(len(path), axis=0), rtol=1e-3)


def test_levels_that_are_dead_take_no_axis_with_them():
    """After four that are about x and z, one about y, which was not moved meanwhile."""
    env = AttitudeEnv(5, world=world(actuators={"dead_levels": [2, 3]}))
    loop, context = flight_loop(wandering, adapts=True), env.context(env.default_params)
    state = env.reset(jax.random.key(0), env.default_params)[1]

    def step(carry, action):
        memory, state = carry
        _, memory = loop.observed(memory, measured(state), context)
        memory = loop.after(memory, action, context)
        return (memory, env.step_env(jax.random.key(0), state, action, env.default_params)[1]), None

    actions = jnp.array([3, 1, 5, 3, 1, 5, 7, 11, 13, 17, 9, 0])  # the middle one about y at last
    (memory, _), _ = jax.lax.scan(step, (loop.init(context), state), actions)
    columns = np.array(memory.identity.columns)
    np.testing.assert_allclose(columns * np.array(LM50.inertia), np.eye(3), rtol=0, atol=0.02)
    strengths = np.array(memory.identity.strengths).reshape(3, 3)
    np.testing.assert_allclose(strengths[0], 1, atol=0.02)
    assert np.all(strengths[1] < 0.1) and np.all(strengths[2, [0, 2]] < 0.1)
