import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv, Spacecraft, evaluation
from attjax import quaternion as quaternions
from attjax.observation import ANGULAR_VELOCITY

pytestmark = pytest.mark.usefixtures("strict_promotion")

ENV = AttitudeEnv(frameskip=20)


def coast(observation, context):
    return 0


def spin_up(observation, context):
    return 3  # +0.5 N m about y


def brake_then_point(observation, context):
    """Some arbitrary feedback that visits many states."""
    wanted = -0.3 * observation[:3] - observation[ANGULAR_VELOCITY]
    error = context.inertia * wanted / context.control_period * 240 - context.torque_table
    return jnp.argmin(jnp.sum(error**2, axis=-1))


def with_steps(env, steps):
    return env.default_params.replace(max_steps_in_episode=jnp.array(steps, jnp.int32))


def evaluate(controller, env, params, seed, episodes):
    flown = evaluation.fly(controller, env, params, jax.random.key(seed), episodes)
    conditions = evaluation.conditions(env, params, seed, episodes)
    return conditions | evaluation.statistics(flown, env, params)


def test_statistics_agree_with_a_plain_loop():
    """One episode at a time, in Python, from the definitions in the contract."""
    episodes, steps = 6, 120
    params = with_steps(ENV, steps)
    params = params.replace(goal_angle=jnp.deg2rad(25.0))  # so that some settle
    flown = evaluation.fly(
        jax.tree_util.Partial(brake_then_point), ENV, params, jax.random.key(5), episodes
    )
    step = jax.jit(ENV.step_env)
    for i, key in enumerate(jax.random.split(jax.random.key(5), episodes)):
        observation, state = ENV.reset(key, params)
        angles, rates, score, impulse = [], [], 0.0, 0.0
        for _ in range(steps):
            action = brake_then_point(observation, ENV.context(params))
            observation, state, reward, terminated, _ = step(key, state, action, params)
            angles.append(float(quaternions.error_angle(state.quaternion)))
            rates.append(float(np.linalg.norm(state.angular_velocity)))
            score += float(reward)
            impulse += float(np.linalg.norm(params.torque_table[action])) / 240
            if terminated:
                break
        closest = int(np.argmin(angles))
        outside = [n + 1 for n, angle in enumerate(angles) if angle > float(params.goal_angle)]
        assert float(flown.closest_angle[i]) == pytest.approx(angles[closest], abs=1e-5)
        assert float(flown.closest_rate[i]) == pytest.approx(rates[closest], abs=1e-5)
        assert float(flown.terminal_angle[i]) == pytest.approx(angles[-1], abs=1e-5)
        assert float(flown.terminal_rate[i]) == pytest.approx(rates[-1], abs=1e-5)
        assert float(flown.score[i]) == pytest.approx(score, rel=1e-4)
        assert float(flown.impulse[i]) == pytest.approx(impulse, rel=1e-4)
        assert int(flown.last_outside[i]) == (outside[-1] if outside else 0)
        assert bool(flown.overspeed[i]) == bool(terminated)
    assert 0 < int(flown.last_outside.min()) < steps


def test_coasting_never_succeeds():
    result = evaluate(jax.tree_util.Partial(coast), ENV, with_steps(ENV, 20), seed=0, episodes=50)
    assert result["success_rate"] == result["overspeed_rate"] == 0
    assert result["settling_time_s"]["never"] == 50
    assert result["settling_time_s"]["mean"] is None
    assert result["terminal_success"]["error_deg"]["max"] is None
    assert result["impulse_N_m_s"]["max"] == 0
    assert result["duration_s"] == pytest.approx(20 * 21 / 240)
    assert result["terminal"]["error_deg"]["min"] > 29.9
    # at rest nothing improves: every step but the last earns exp(-φ/0.28π) − 1
    assert -20 < result["episode_return"]["max"] < 0


def test_overspeed_ends_an_episode_and_freezes_its_figures():
    env = AttitudeEnv(frameskip=0)
    params = with_steps(env, 100)
    result = evaluate(jax.tree_util.Partial(spin_up), env, params, 0, 20)
    assert result["overspeed_rate"] == 1 and result["success_rate"] == 0
    # 0.5/240/0.115 rad/s a step: the 28th exceeds 0.5 rad/s
    kick = 0.5 / 240 / 0.115
    steps = int(np.floor(0.5 / kick)) + 1
    assert result["terminal"]["rate_rad_s"]["max"] == pytest.approx(steps * kick, rel=1e-3)
    assert result["impulse_N_m_s"]["mean"] == pytest.approx(steps * 0.5 / 240, rel=1e-4)
    assert result["episode_return"]["max"] < -50 + steps


def test_a_spacecraft_that_starts_at_the_goal_settles_at_the_first_sample():
    params = with_steps(ENV, 10).replace(min_slew_angle=jnp.zeros(()), max_slew_angle=jnp.zeros(()))
    result = evaluate(jax.tree_util.Partial(coast), ENV, params, 0, 5)
    assert result["success_rate"] == 1
    assert result["settling_time_s"]["max"] == pytest.approx(ENV.control_period)
    assert result["episode_return"]["mean"] == pytest.approx(9 * 9 + 50, abs=10)


def test_summary_agrees_with_numpy():
    x = np.random.default_rng(0).normal(size=1001)
    summary = evaluation.summarize(x)
    assert list(summary) == ["mean", "std", "min", "q1", "q2", "q3", "max"]
    assert summary["q1"] == np.percentile(x, 25) and summary["std"] == x.std()


def test_sums_over_a_long_episode_do_not_drift():
    """200,000 steps in single precision, each the same: the sums in closed form."""
    heavy = Spacecraft(inertia=(1e6, 1e6, 1e6), duration=200_000 / 240, slew_angles_deg=(90, 90))
    env = AttitudeEnv(0, spacecraft=heavy)
    push = jax.tree_util.Partial(lambda observation, context: jnp.array(7))  # 0.05 N m
    flown = evaluation.fly(push, env, env.default_params, jax.random.key(0), 1)
    np.testing.assert_allclose(flown.impulse, 0.05 / 240 * 200_000, rtol=2e-7)
    still = jax.tree_util.Partial(coast)
    flown = evaluation.fly(still, env, env.default_params, jax.random.key(0), 1)
    expected = (np.exp(-0.25 / 0.14) - 1) * 199_999  # Eq. 12 at 90°; the last step earns 0
    np.testing.assert_allclose(flown.score, expected, rtol=1e-6)
