"""The classical laws on continuous torques: the wanted impulse itself, and every slew flown."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv, Spacecraft, evaluation
from attjax.control import classical, time_optimal
from attjax.envs import observation

ENV = AttitudeEnv(frameskip=5, actions="continuous")
CONTEXT = ENV.context(ENV.default_params)
INERTIA = np.array([0.872, 0.115, 0.797])


def observed(quaternion, rate):
    return observation.observe(jnp.array(quaternion, float), jnp.array(rate, float))


def test_the_action_is_the_wanted_impulse_clipped_about_each_axis():
    rng = np.random.default_rng(2)
    clipped = 0
    for _ in range(100):
        rate, wanted = rng.normal(size=(2, 3)) * 10 ** rng.uniform(-5, -2)
        told = observed([0, 0, 0, 1], rate)
        ours = classical.nearest_action(jnp.array(wanted, float), told, CONTEXT)
        impulse = INERTIA * (wanted - rate)
        expected = np.clip(impulse / (0.5 / 240), -1, 1)
        np.testing.assert_allclose(ours, expected, rtol=1e-4, atol=1e-6)
        clipped += np.any(np.abs(expected) == 1)
    assert 5 < clipped < 95


@pytest.mark.parametrize("controller", classical.CONTROLLERS.values())
def test_laws_coast_at_the_goal_and_turn_towards_it_the_shorter_way(controller):
    assert not controller(observed([0, 0, 0, 1], [0, 0, 0]), CONTEXT).any()
    rng = np.random.default_rng(1)
    for _ in range(10):
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        action = controller(observed(quaternion, [0, 0, 0]), CONTEXT)
        np.testing.assert_array_equal(np.sign(action), -np.sign(quaternion[3] * quaternion[:3]))
        other = controller(observed(-quaternion, [0, 0, 0]), CONTEXT)
        np.testing.assert_array_equal(action, other)


def test_the_axis_that_takes_longest_rules_the_braking():
    """With η = 3/4 and U the average of the largest torque: ω = θ √(2 η U / (I θ))."""
    angle, largest = np.array([0.3, -0.9, 0.2]), 0.5 / 6
    ours = classical.momentum_to_give(jnp.array(angle), CONTEXT)
    assert float(ours) == pytest.approx(0.872 * 0.3, rel=1e-6)
    slew = np.array([np.sin(0.6), 0, 0, np.cos(0.6)])
    time = time_optimal.time_optimal_reference(jnp.array(slew), CONTEXT)
    assert float(time) == pytest.approx(2 * np.sqrt(1.2 * 0.872 / largest), rel=1e-5)
    without = Spacecraft(torque_axes=((0, 1, 0), (0, 0, 1)))  # about x there is none
    env = AttitudeEnv(5, spacecraft=without, actions="continuous")
    context = env.context(env.default_params)
    ours = classical.momentum_to_give(jnp.array(angle), context)
    assert float(ours) == pytest.approx(0.797 * 0.2, rel=1e-6)
    action = classical.phase_plane(observed(slew, [0.1, 0.1, 0]), context)
    assert action[0] == 0 and action[1] == -1


@pytest.mark.parametrize(
    "name, frameskip, error_deg, settling_s",
    [
        ("phase-plane", 5, 1e-6, 7.0),
        ("phase-plane", 20, 1e-6, 13.0),
        ("feedback", 5, 1e-3, 20.5),
        ("feedback", 20, 0.25, 38.0),
    ],
)
def test_laws_fly_every_slew(name, frameskip, error_deg, settling_s):
    env = AttitudeEnv(frameskip, actions="continuous")
    controller = jax.tree_util.Partial(classical.CONTROLLERS[name])
    flown = evaluation.fly(controller, env, env.default_params, jax.random.key(1), 200)
    result = evaluation.statistics(flown, env, env.default_params)
    assert result["success_rate"] == 1 and result["overspeed_rate"] == 0
    assert result["terminal"]["error_deg"]["max"] < error_deg
    assert result["settling_time_s"]["mean"] < settling_s
