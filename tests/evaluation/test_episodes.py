import jax
import jax.numpy as jnp
import numpy as np
import pytest

import attjax
from attjax import AttitudeEnv, EnvState, Spacecraft, evaluation
from attjax.dynamics import quaternion as quaternions
from attjax.envs.observation import ANGULAR_VELOCITY
from attjax.evaluation import paper

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
    expected = [x.mean(), x.std(), x.min(), *np.percentile(x, [25, 50, 75]), x.max()]
    assert list(summary.values()) == expected
    assert evaluation.summarize(np.array([2.0])) == dict(zip(summary, [2, 0, 2, 2, 2, 2, 2]))
    assert evaluation.summarize(np.array([])) == dict.fromkeys(summary)


def test_the_impulse_of_a_long_episode_does_not_drift():
    """200,000 steps in single precision, each the same: the sum in closed form."""
    heavy = Spacecraft(inertia=(1e6, 1e6, 1e6), duration=200_000 / 240)
    env = AttitudeEnv(0, spacecraft=heavy)
    push = jax.tree_util.Partial(lambda observation, context: jnp.array(7))  # 0.05 N m
    flown = evaluation.fly(push, env, env.default_params, jax.random.key(0), 1)
    np.testing.assert_allclose(flown.impulse, 0.05 / 240 * 200_000, rtol=2e-7)


def test_the_closest_sample_is_kept_with_its_rate():
    """Straight through the goal at a constant rate: past it the error grows again."""
    rate, steps = 0.1, 10
    env = AttitudeEnv(20, initial_state=turning_towards_the_goal)
    params = with_steps(env, steps).replace(goal_angle=jnp.array(0.065))
    flown = evaluation.fly(kick_late(), env, params, jax.random.key(0), 2)
    # From 0.0275 rad before the goal, 0.00875 rad a step.
    angles = 0.0275 - 0.00875 * np.arange(1, steps + 1)
    assert np.argmin(np.abs(angles)) == 2 and angles[2] == pytest.approx(0.00125)
    np.testing.assert_allclose(flown.closest_angle, 0.00125, atol=1e-6)
    np.testing.assert_allclose(flown.closest_rate, rate, rtol=1e-5)
    kicked = rate + 0.5 / 240 / 0.872  # one + 0.5 N m about x in the last step
    np.testing.assert_allclose(flown.terminal_rate, kicked, rtol=1e-4)
    after = -angles[-2] + rate / 240 / 2 + kicked / 240 / 2 + kicked * 20 / 240
    np.testing.assert_allclose(flown.terminal_angle, after, atol=1e-6)
    assert not flown.last_outside.any()
    history = evaluation.statistics(flown, env, params)
    assert history["closest"]["error_deg"]["max"] == pytest.approx(np.rad2deg(0.00125), rel=1e-3)
    assert history["closest"]["rate_rad_s"]["max"] == pytest.approx(rate, rel=1e-5)
    assert history["terminal"]["rate_rad_s"]["min"] == pytest.approx(kicked, rel=1e-4)


def test_of_equal_angles_the_first_counts_and_the_goal_angle_is_inside(monkeypatch):
    """Three pushes while the angle is kept at 0.25 rad."""
    monkeypatch.setattr(quaternions, "error_angle", lambda q: 0.25 + 0 * q[3])
    env = AttitudeEnv(0)
    params = with_steps(env, 3).replace(goal_angle=jnp.array(0.25))
    flown = evaluation.fly(jax.tree_util.Partial(spin_up), env, params, jax.random.key(0), 1)
    kick = 0.5 / 240 / 0.115
    np.testing.assert_allclose(flown.closest_rate, kick, rtol=1e-5)
    np.testing.assert_allclose(flown.terminal_rate, 3 * kick, rtol=1e-5)
    assert flown.last_outside.tolist() == [0]


def turning_towards_the_goal(key, params):
    half = -0.0275 / 2
    quaternion = jnp.array([np.sin(half), 0, 0, np.cos(half)], float)
    return EnvState(quaternion, jnp.array([0.1, 0, 0]), jnp.array(0, jnp.int32))


def kick_late():
    """+0.5 N m about x once the goal lies more than 0.045 rad behind."""
    return jax.tree_util.Partial(lambda observation, _: jnp.where(observation[0] > 0.0225, 1, 0))


@pytest.mark.parametrize("held, duration", [(False, 1 / 240), (True, 0.1)])
def test_a_torque_counts_for_as_long_as_it_acts(held, duration):
    """0.003 N m in 12 of 40 steps of 0.1 s."""
    spacecraft = Spacecraft(inertia=(1, 1, 1), torque_levels=(0.003,), torque_held=held)
    env = AttitudeEnv(23, spacecraft=spacecraft)
    params = with_steps(env, 40)
    step = 0.003 * duration  # rad/s, by which the rate grows in each step of the twelve
    act = jax.tree_util.Partial(lambda w, _: jnp.where(w[8] < 11.5 * step, 1, 0))
    flown = evaluation.fly(act, env, params, jax.random.key(0), 3)
    np.testing.assert_allclose(flown.impulse, 12 * 0.003 * duration, rtol=1e-5)
    np.testing.assert_allclose(flown.terminal_rate, 12 * step, rtol=1e-5)
    assert flown.last_outside.tolist() == [40] * 3  # never near the goal


def test_recorded_steps_are_those_of_the_simulator():
    """Step by step with attjax.step, past the rate limit too: nothing ends."""
    start = paper.table_5_slews()
    act = jax.tree_util.Partial(lambda q, _: jnp.where(q[0] > 0, 3, 2))
    history = evaluation.record(act, ENV, ENV.default_params, jax.random.key(0), start, 32)
    state, step = jax.tree.map(lambda x: x[2], start), jax.jit(attjax.step)
    for n in range(32):
        action = 3 if state.quaternion[0] > 0 else 2
        state = step(state, action)
        np.testing.assert_allclose(history.quaternion[n, 2], state.quaternion, atol=2e-6)
        np.testing.assert_allclose(
            history.angular_velocity[n, 2], state.angular_velocity, atol=2e-6
        )
        torque = ENV.default_params.torque_table[action]
        np.testing.assert_array_equal(history.torque[n, 2], torque)
    assert len(history.torque) == 32


def test_conditions_and_settling_times_worked_by_hand():
    env = AttitudeEnv(5)
    params = with_steps(env, 400).replace(goal_angle=jnp.array(0.1))
    zeros = np.zeros(4, np.float32)
    flown = evaluation.Episodes(
        closest_angle=zeros,
        closest_rate=zeros,
        terminal_angle=np.array([0.1, 0.05, 0.05, 0.2], np.float32),  # on the edge is inside
        terminal_rate=np.array([1, 2, 3, 4], np.float32),
        overspeed=np.array([False, False, True, False]),
        last_outside=np.array([0, 79, 9, 400]),
        score=np.array([1, 2, 3, 4], np.float32),
        impulse=np.array([4, 3, 2, 1], np.float32),
    )
    assert evaluation.conditions(env, params, 7, 4) == {
        "episodes": 4,
        "frameskip": 5,
        "control_hz": 40.0,
        "duration_s": 10.0,
        "seed": 7,
    }
    assert evaluation.successes(flown, params).tolist() == [True, True, False, False]
    np.testing.assert_allclose(evaluation.settling_times(flown, env), [0.025, 2, 0.25, 10.025])
    result = evaluation.statistics(flown, env, params)
    assert result["success_rate"] == 0.5 and result["overspeed_rate"] == 0.25
    assert result["settling_time_s"]["never"] == 2
    assert result["settling_time_s"]["mean"] == pytest.approx((0.025 + 2) / 2)
    assert result["terminal_success"]["rate_rad_s"]["max"] == 2
    assert result["terminal_success"]["error_deg"]["max"] == pytest.approx(np.rad2deg(0.1))
    assert result["terminal"]["rate_rad_s"]["max"] == 4
    assert result["episode_return"]["mean"] == 2.5 and result["impulse_N_m_s"]["max"] == 4


def test_one_episode_is_flown_and_none_is_refused():
    one = evaluation.fly(
        jax.tree_util.Partial(coast), ENV, with_steps(ENV, 1), jax.random.key(0), 1
    )
    assert one.score.shape == (1,)
    with pytest.raises(ValueError, match="episodes is 0; it must be an integer at least 1"):
        evaluation.fly(jax.tree_util.Partial(coast), ENV, with_steps(ENV, 1), jax.random.key(0), 0)


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
