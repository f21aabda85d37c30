"""Every reward branch against an independent float64 computation in NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv, EnvState
from attjax.dynamics import quaternion as quaternions
from attjax.envs.reward import (
    REWARDS,
    Transition,
    binary_reward,
    logarithmic_reward,
    paper_reward,
    scalar_part_increased,
)

pytestmark = pytest.mark.usefixtures("strict_promotion")

GOAL = np.deg2rad(0.25)


def quaternion(degrees, axis=(0.6, -0.48, 0.64)):
    half = np.deg2rad(degrees) / 2
    return np.array([*(np.array(axis) * np.sin(half)), np.cos(half)])


def expected_reward(before_deg, after_deg, terminated, truncated, exponential=True):
    """Eq. 12-13 from the angles themselves: q_s = cos(φ/2) falls with φ on [0°, 360°]."""
    if terminated:
        return -50.0
    if truncated:
        return 50.0 if after_deg <= 0.25 else 0.0
    reward = np.exp(-np.deg2rad(after_deg) / (0.14 * 2 * np.pi)) if exponential else 0.0
    if not after_deg < before_deg:
        reward -= 1
    return reward + 9 if after_deg <= 0.25 else reward


def transition(before, after, terminated=False, truncated=False, period=0.0875):
    return Transition(
        quaternion=jnp.array(before, float),
        next_quaternion=jnp.array(after, float),
        next_angular_velocity=jnp.zeros(3),
        terminated=jnp.array(terminated),
        truncated=jnp.array(truncated),
        goal_angle=jnp.array(GOAL, float),
        control_period=jnp.array(period, float),
        impulse=jnp.zeros(3),
    )


ANGLES = [
    1e-6,
    1e-5,
    1e-3,
    0.03,
    0.2499,
    0.2501,
    1,
    89,
    91,
    119,
    121,
    150,
    179,
    181,
    239,
    241,
    359.999,
]


@pytest.mark.parametrize("reward", [paper_reward, binary_reward])
@pytest.mark.parametrize("terminated, truncated", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_paper_reward_with_and_without_the_exponential(reward, terminated, truncated):
    for after in ANGLES:
        for ratio in (0.99, 0.9999, 1.0001, 1.01):
            before = after + (ratio - 1) * min(after, 360 - after)
            ours = reward(
                transition(quaternion(before), quaternion(after), bool(terminated), bool(truncated))
            )
            exponential = reward is paper_reward
            expected = expected_reward(before, after, terminated, truncated, exponential)
            assert float(ours) == pytest.approx(expected, abs=2e-6), (before, after)


def test_reward_at_180_degrees_follows_the_formula_not_the_remark():
    ours = paper_reward(transition(quaternion(180.5), quaternion(180)))
    assert float(ours) == pytest.approx(0.0281, abs=1e-4)


def test_staying_is_no_improvement():
    q = quaternion(10)
    assert paper_reward(transition(q, q)) < 0


def test_improvement_is_seen_where_float32_q_s_is_constant():
    before, after = quaternion(0.011), quaternion(0.010)
    assert np.float32(before[3]) == np.float32(after[3]) == 1
    assert scalar_part_increased(jnp.array(before, jnp.float32), jnp.array(after, jnp.float32))
    assert not scalar_part_increased(jnp.array(after, jnp.float32), jnp.array(before, jnp.float32))


def test_improvement_agrees_with_exact_scalar_parts(x64):
    rng = np.random.default_rng(0)
    q = rng.normal(size=(20_000, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    before, after = q[::2], q[1::2]
    ours = jax.vmap(scalar_part_increased)(jnp.array(before), jnp.array(after))
    np.testing.assert_array_equal(ours, after[:, 3] > before[:, 3])


@pytest.mark.parametrize("period", [0.025, 0.0875])
@pytest.mark.parametrize("truncated", [False, True])
def test_logarithmic_reward(period, truncated):
    for degrees in ANGLES:
        ours = logarithmic_reward(
            transition(quaternion(1), quaternion(degrees), truncated=truncated, period=period)
        )
        expected = -np.log10(np.deg2rad(degrees) + 1e-6) * period / 0.025
        assert float(ours) == pytest.approx(expected, abs=1e-5)


def test_logarithmic_reward_punishes_overspeed():
    assert logarithmic_reward(transition(quaternion(1), quaternion(1), terminated=True)) == -50


@pytest.mark.parametrize("reward", REWARDS.values(), ids=REWARDS)
@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["goal", "antipode"])
def test_gradients_at_rest_at_the_goal_are_finite(reward, sign):
    """Of the error angle, of the reward, and through an agent step of any action."""
    env = AttitudeEnv(5, reward)

    def rewarded(quaternion, angular_velocity):
        state = EnvState(quaternion, angular_velocity, jnp.array(0))
        return env.step_env(None, state, 0, env.default_params)[2]

    goal, rest = jnp.array([0.0, 0, 0, sign]), jnp.zeros(3)
    assert jax.grad(quaternions.error_angle)(goal).tolist() == [0, 0, 0, 0]
    for gradient in jax.grad(rewarded, (0, 1))(goal, rest):
        assert np.all(np.isfinite(gradient))
    near = goal.at[0].set(1e-6)
    assert abs(float(jax.grad(quaternions.error_angle)(near)[0])) == pytest.approx(2, rel=1e-5)


def test_the_edge_of_the_goal_is_inside():
    """φ = 2 atan2(1, 1), a quarter turn, against a goal of as much."""
    q = jnp.array([1.0, 0, 0, 1.0])
    edge = transition(q, q)._replace(goal_angle=quaternions.error_angle(q))
    assert paper_reward(edge) == pytest.approx(np.exp(-0.25 / 0.14) - 1 + 9)
    assert paper_reward(edge._replace(truncated=jnp.array(True))) == 50


def test_improvement_is_that_of_the_rotation_not_of_the_length():
    """Near the goal and near the antipode; 9° against 10°, each longer or shorter."""
    for sign in (1, -1):
        near, far = sign * quaternion(9), sign * quaternion(10)
        for scale in (0.9, 1.1):
            closer = scalar_part_increased(jnp.array(scale * far), jnp.array(near))
            farther = scalar_part_increased(jnp.array(scale * near), jnp.array(far))
            assert (closer, farther) == ((True, False) if sign > 0 else (False, True))


def test_the_binary_reward_is_of_integers_before_the_end():
    """Farther, closer, closer and inside, farther but inside."""
    angles = [(10, 11), (11, 10), (0.3, 0.2), (0.1, 0.2)]
    ours = [float(binary_reward(transition(*map(quaternion, pair)))) for pair in angles]
    assert ours == [-1, 0, 9, 8]


@pytest.mark.parametrize("degrees", [10, 90, 180, 270, 350])
def test_no_attitude_improves_on_itself(degrees):
    q = jnp.array(quaternion(degrees))
    assert not scalar_part_increased(q, q)
