import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attjax import AttitudeEnv, Spacecraft, evaluation
from attjax.control import classical
from attjax.dynamics import quaternion as quaternions
from attjax.envs import observation

ENV = AttitudeEnv(frameskip=5)
CONTEXT = ENV.context(ENV.default_params)


def act(controller, quaternion, angular_velocity, context=CONTEXT):
    observed = observation.observe(jnp.array(quaternion, float), jnp.array(angular_velocity, float))
    return int(jax.jit(controller)(observed, context))


def test_rotation_vector_agrees_with_scipy():
    rng = np.random.default_rng(0)
    q = rng.normal(size=(100, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    ours = jax.vmap(quaternions.rotation_vector)(jnp.array(q))
    np.testing.assert_allclose(ours, Rotation.from_quat(q).as_rotvec(), atol=2e-6)
    assert not quaternions.rotation_vector(jnp.array([0.0, 0, 0, 1])).any()


@pytest.mark.parametrize("controller", classical.CONTROLLERS.values())
def test_controllers_coast_at_the_goal_and_turn_towards_it(controller):
    assert act(controller, [0, 0, 0, 1], [0, 0, 0]) == 0
    for axis in range(3):
        for sign in (1, -1):
            quaternion = np.zeros(4)
            quaternion[axis], quaternion[3] = sign * np.sin(0.5), np.cos(0.5)
            torque = np.asarray(CONTEXT.torque_table)[act(controller, quaternion, [0, 0, 0])]
            np.testing.assert_array_equal(np.sign(torque), -sign * np.eye(3)[axis])


@pytest.mark.parametrize("controller", classical.CONTROLLERS.values())
def test_controllers_take_the_shorter_way(controller):
    """q and −q are the same attitude."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        rate = 0.1 * rng.normal(size=3)
        assert act(controller, quaternion, rate) == act(controller, -quaternion, rate)


@pytest.mark.parametrize("controller", classical.CONTROLLERS.values())
def test_gains_are_the_laws_own(controller):
    """Each gain of one law changes what it does; those of the other do not."""
    gains = {"braking_margin": 0.2, "terminal_gain": 0.1, "bandwidth": 0.4, "rate_margin": 0.3}
    mine = {"rate_margin"} | (
        {"bandwidth"} if controller is classical.quaternion_feedback else {*gains} - {"bandwidth"}
    )
    turns, shares = np.meshgrid(np.geomspace(1e-4, 2, 20), np.linspace(-4, 0, 40))
    rates = jnp.asarray(np.outer((turns * shares).ravel(), [1, 0, 0]), float)
    ones = np.outer(np.sin(turns / 2).ravel(), [1, 0, 0])
    attitudes = jnp.asarray(np.column_stack([ones, np.cos(turns / 2).ravel()]), float)

    def actions(gains):
        told = jax.vmap(observation.observe)(attitudes, rates)
        return np.asarray(jax.vmap(lambda x: controller(x, CONTEXT, gains))(told))

    usual = actions(classical.GAINS)
    for name, value in gains.items():
        others = actions(classical.Gains(**{name: value}))
        assert np.any(usual != others) == (name in mine), name


def test_nearest_action_by_brute_force():
    rng = np.random.default_rng(2)
    table, inertia = np.asarray(CONTEXT.torque_table), np.asarray(CONTEXT.inertia)
    for _ in range(100):
        rate, wanted = rng.normal(size=(2, 3)) * 10 ** rng.uniform(-4, -1)
        if np.linalg.norm(wanted) > 0.45:
            wanted *= 0.45 / np.linalg.norm(wanted)
        distances = [np.linalg.norm(inertia * (wanted - rate) - row / 240) for row in table]
        observed = observation.observe(jnp.array([0.0, 0, 0, 1]), jnp.array(rate))
        ours = classical.nearest_action(jnp.array(wanted), observed, CONTEXT)
        assert distances[int(ours)] == pytest.approx(min(distances), rel=1e-4)


def test_full_inertia_gives_the_same_actions_as_its_diagonal():
    full = CONTEXT.replace(inertia=jnp.diag(CONTEXT.inertia))
    rng = np.random.default_rng(3)
    for _ in range(20):
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        rate = 0.1 * rng.normal(size=3)
        for controller in classical.CONTROLLERS.values():
            assert act(controller, quaternion, rate) == act(controller, quaternion, rate, full)


def test_feedback_does_not_depend_on_the_axes_that_it_is_written_in(x64):
    """The same spacecraft in turned axes: inertia, torques, attitude and rate turn along."""
    turn = Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix()
    context = ENV.context(ENV.default_params)
    turned = context.replace(
        inertia=turn @ jnp.diag(context.inertia) @ turn.T,
        torque_table=context.torque_table @ turn.T,
    )
    rng = np.random.default_rng(4)
    for _ in range(100):
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        rate = 0.1 * rng.normal(size=3)
        expected = act(classical.quaternion_feedback, quaternion, rate, context)
        state = [*(turn @ quaternion[:3]), quaternion[3]], turn @ rate
        assert act(classical.quaternion_feedback, *state, turned) == expected


@pytest.mark.parametrize(
    "name, error_deg, settling_s", [("phase-plane", 5e-4, 9.0), ("feedback", 0.02, 25.0)]
)
def test_controllers_fly_every_slew(name, error_deg, settling_s):
    controller = jax.tree_util.Partial(classical.CONTROLLERS[name])
    flown = evaluation.fly(controller, ENV, ENV.default_params, jax.random.key(1), 500)
    result = evaluation.statistics(flown, ENV, ENV.default_params)
    assert result["success_rate"] == 1 and result["overspeed_rate"] == 0
    assert result["terminal"]["error_deg"]["mean"] < error_deg
    assert result["settling_time_s"]["mean"] < settling_s


def test_the_momentum_of_a_turn_is_shared_among_the_torques_that_there_are():
    """Of axes that are askew, and where one of them gives half of the others."""
    angle = jnp.array([0.3, -0.9, 0.2])
    plain = classical.momentum_to_give(angle, CONTEXT)
    assert plain == jnp.sum(jnp.abs(CONTEXT.inertia * angle))  # to the bit
    axes = np.array([[1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.0, -0.6, 0.8]])
    env = AttitudeEnv(5, spacecraft=Spacecraft(torque_axes=tuple(map(tuple, axes.tolist()))))
    context = env.context(env.default_params)
    turn = np.linalg.solve(np.diag(context.inertia), axes.T @ [2.0, -3.0, 0.5])
    ours = classical.momentum_to_give(jnp.array(turn), context)
    assert float(ours) == pytest.approx(2 + 3 + 0.5, rel=1e-5)
    is_of_first = np.arange(-1, 18) // 2 % 3 == 0
    weak = context.torque_table * np.where(is_of_first, 0.5, 1)[:, None]
    ours = classical.momentum_to_give(
        jnp.array(turn), dataclasses.replace(context, torque_table=weak)
    )
    assert float(ours) == pytest.approx(2 / 0.5 + 3 + 0.5, rel=1e-5)


@pytest.mark.parametrize("change", ["in a plane", "of no pairs", "of another number"])
def test_of_torques_that_are_not_three_axes_in_space_the_bodys_axes_count(change):
    angle, table = jnp.array([0.3, -0.9, 0.2]), np.array(CONTEXT.torque_table)
    if change == "in a plane":
        table[:, 2] = 0.5 * table[:, 0]
        table[5:7] = table[1:3] + table[3:5]
    elif change == "of no pairs":
        table = table[:, [1, 2, 0]] * np.array([1, 0.5, 0.2]) + 0.01
    else:
        table = table[:5]
    context = dataclasses.replace(CONTEXT, torque_table=jnp.asarray(table))
    ours = classical.momentum_to_give(angle, context)
    assert ours == jnp.sum(jnp.abs(CONTEXT.inertia * angle))
