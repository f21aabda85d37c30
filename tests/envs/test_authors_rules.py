"""The rules of the authors' public code, as options of the environment."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import attjax
from attjax import AttitudeEnv
from attjax.control import classical
from attjax.control.time_optimal import time_optimal_reference
from attjax.envs.reward import REWARDS, Transition, paper_reward

pytestmark = pytest.mark.usefixtures("strict_promotion")

THEIRS = AttitudeEnv(20, REWARDS["authors"], kinematic_factor=1.0, observes_quaternion_rate=False)
START = attjax.EnvState(
    jnp.array([0.48, -0.36, 0.48, 0.64]), jnp.array([0.1, -0.2, 0.05]), jnp.array(0, jnp.int32)
)


def transitions(count):
    """Random steps from 0.02° to 360°, a quarter near the goal, some of them the last."""
    rng = np.random.default_rng(5)
    degrees = np.where(rng.random(count) < 0.25, rng.uniform(0.02, 0.4, count), 360)
    degrees = np.where(degrees == 360, rng.uniform(1, 359, count), degrees)
    axes = rng.normal(size=(2, count, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    before = degrees * rng.uniform(0.9, 1.1, count)
    angles = np.deg2rad([np.minimum(before, 360), degrees])
    q = np.concatenate([axes * np.sin(angles / 2)[..., None], np.cos(angles / 2)[..., None]], -1)
    pulses = rng.choice([0.0, 0.005, 0.05, 0.5], (count, 3)) * rng.choice([-1, 1], (count, 3))
    terminated, truncated = rng.random((2, count)) < 0.2
    return q, pulses, terminated, truncated & ~terminated


def expected_reward(q, pulse, terminated, truncated, is_continuous):
    """Their reward in float64, from q_s, whose arc cosine is exact enough there."""
    before, after = q[:, 3]
    inside = after >= 0.99999762
    if terminated:
        return -25.0
    if truncated:
        return 50.0 if inside else 0.0
    reward = np.exp(-2 * np.arccos(after) / (0.14 * 2 * np.pi))
    reward -= 0.5 * np.linalg.norm(pulse / 0.5) if is_continuous else 0
    reward -= 0 if after > before else 1
    return reward + 9 if inside else reward


@pytest.mark.parametrize("name", ["authors", "authors-continuous"])
def test_rewards_are_those_of_the_authors_code(x64, name):
    q, pulses, terminated, truncated = transitions(2000)
    given = Transition(
        *map(jnp.asarray, q), jnp.zeros((2000, 3)), jnp.asarray(terminated), jnp.asarray(truncated),
        jnp.full(2000, np.deg2rad(0.25)), jnp.full(2000, 0.0875), jnp.asarray(pulses / 240),
    )  # fmt: skip
    ours = np.asarray(jax.vmap(REWARDS[name])(given))
    rows = zip(q.swapaxes(0, 1), pulses, terminated, truncated)
    expected = np.array([expected_reward(*row, name == "authors-continuous") for row in rows])
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-6)
    ended = expected[terminated | truncated]
    assert set(ended) == {-25, 0, 50} and np.sum(expected > 8) > 100


def test_the_score_stays_that_of_the_paper():
    params = THEIRS.default_params.replace(rate_limit=jnp.array(0.1))
    _, _, reward, terminated, info = THEIRS.step_env(None, START, 1, params)
    assert (float(reward), bool(terminated), float(info["score"])) == (-25, True, -50)


def test_the_observed_rate_is_that_of_the_kinematics():
    """Twice that of Eq. 9 without the ½, and zeros where it is not observed."""
    q, w = START.quaternion, START.angular_velocity
    usual = AttitudeEnv().observe(None, START, None)
    product = Rotation.from_quat(np.asarray(q)).as_matrix() @ np.asarray(w)  # ω, inertial frame
    vector = q[3] * product + np.cross(product, np.asarray(q[:3]))
    faster = AttitudeEnv(kinematic_factor=1.0).observe(None, START, None)
    np.testing.assert_allclose(faster[4:8], [*vector, -product @ np.asarray(q[:3])], atol=1e-7)
    np.testing.assert_array_equal(faster[4:8], 2 * usual[4:8])
    ours = THEIRS.observe(None, START, None)
    np.testing.assert_array_equal(ours, usual.at[4:8].set(0))
    for env in (THEIRS, AttitudeEnv(kinematic_factor=1.0)):
        assert env.observation_space(env.default_params).shape == (11,)
    space = AttitudeEnv(kinematic_factor=1.0).observation_space(THEIRS.default_params)
    np.testing.assert_array_equal(space.high[4:8], np.full(4, space.high[8]))


def test_the_environment_steps_by_its_kinematics(x64):
    """A spin about x, at which 0.5 N m pushes, turns twice as far as by Eq. 9."""
    start = attjax.EnvState(jnp.array([0.0, 0, 0, 1]), jnp.zeros(3), jnp.array(0, jnp.int32))
    angles = []
    for env in (AttitudeEnv(20), THEIRS):
        state = env.step_env(None, start, 1, env.default_params)[1]
        angles.append(float(state.quaternion[0]))
        alone = attjax.step(start, 1, env.default_params, 20, env.kinematic_factor)
        np.testing.assert_allclose(alone.quaternion, state.quaternion, rtol=0, atol=1e-15)
    acceleration, dt = 0.5 / 0.872, 1 / 240
    turned = acceleration * dt**2 / 2 + acceleration * dt * 20 * dt
    np.testing.assert_allclose(2 * np.arcsin(angles), [turned, 2 * turned], rtol=1e-10)


@pytest.mark.parametrize("controller", classical.CONTROLLERS.values(), ids=classical.CONTROLLERS)
def test_classical_laws_know_the_kinematics(controller):
    """They settle √2 times as fast: the angle that ω has to integrate to is half the angle."""
    settling = []
    for factor in (0.5, 1.0):
        env = AttitudeEnv(5, kinematic_factor=factor)
        judged = attjax.evaluate(controller, env, episodes=30)
        assert judged["success_rate"] == 1
        settling.append(judged["settling_time_s"]["mean"])
    assert settling[1] == pytest.approx(settling[0] / np.sqrt(2), rel=0.1)


def test_the_time_optimal_reference_knows_the_kinematics():
    q = START.quaternion
    contexts = [env.context(env.default_params) for env in (AttitudeEnv(20), THEIRS)]
    usual, theirs = (float(time_optimal_reference(q, context)) for context in contexts)
    assert theirs == pytest.approx(usual / np.sqrt(2), rel=1e-6)


@pytest.mark.parametrize("factor", [0, -0.5, 1.5, float("nan"), True, "0.5", None])
def test_bad_factors_are_refused(factor):
    for make in (AttitudeEnv, functools.partial(attjax.step, START, 0)):
        with pytest.raises(ValueError, match=r"kinematic_factor is .* above 0 and at most 1$"):
            make(kinematic_factor=factor)


def test_what_is_no_bool_is_refused():
    with pytest.raises(ValueError, match="observes_quaternion_rate is 0; it must be True or False"):
        AttitudeEnv(observes_quaternion_rate=0)


def test_the_default_is_the_papers():
    assert AttitudeEnv() == AttitudeEnv(20, paper_reward, kinematic_factor=0.5)
    assert AttitudeEnv() != AttitudeEnv(kinematic_factor=1.0)
