import jax
import jax.numpy as jnp
import numpy as np
import pytest

import attjax
from attjax import quaternion as quaternions
from attjax import spacecraft
from attjax.specification import LM50

pytestmark = pytest.mark.usefixtures("strict_promotion")


def states(n, seed=0):
    params = spacecraft.default_params()
    keys = jax.random.split(jax.random.key(seed), n)
    return jax.vmap(spacecraft.initial_state, (0, None))(keys, params)


def test_torques_are_table_1():
    assert LM50.num_actions == 19
    expected = [[0, 0, 0]]
    for magnitude in (0.5, 0.05, 0.005):
        for axis in range(3):
            for sign in (1, -1):
                row = [0.0, 0.0, 0.0]
                row[axis] = sign * magnitude
                expected.append(row)
    np.testing.assert_array_equal(LM50.torque_table, expected)


def test_initial_slews_are_uniform_in_angle_and_axis():
    n = 200_000
    start = states(n)
    np.testing.assert_array_equal(start.angular_velocity, np.zeros((n, 3)))
    np.testing.assert_array_equal(start.time, np.zeros(n))
    q = np.asarray(start.quaternion, np.float64)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-6)
    degrees = np.rad2deg(np.asarray(jax.vmap(quaternions.error_angle)(start.quaternion)))
    assert degrees.min() >= 30 - 1e-4 and degrees.max() <= 150 + 1e-4
    # Standard errors: 120/√12/√n = 0.08° of the mean; each decile has n/10 ± √(0.09 n).
    assert degrees.mean() == pytest.approx(90, abs=0.4)
    counts, _ = np.histogram(degrees, np.linspace(30, 150, 11))
    np.testing.assert_allclose(counts, n / 10, atol=5 * np.sqrt(0.09 * n))
    # A uniform axis has mean 0 and second moments 1/3 (each ± 0.3/√n), fourth moments 1/5.
    axes = q[:, :3] / np.linalg.norm(q[:, :3], axis=1, keepdims=True)
    np.testing.assert_allclose(axes.mean(axis=0), 0, atol=5 * 0.58 / np.sqrt(n))
    np.testing.assert_allclose(axes.T @ axes / n, np.eye(3) / 3, atol=5 * 0.3 / np.sqrt(n))
    np.testing.assert_allclose((axes**4).mean(axis=0), 1 / 5, atol=5 * 0.27 / np.sqrt(n))
    # Angle and axis are independent.
    assert np.abs(np.corrcoef(degrees, axes.T)[0, 1:]).max() < 5 / np.sqrt(n)


def test_near_goal_starts_cover_every_decade_of_angle_and_rate():
    n = 100_000
    params = spacecraft.default_params()
    starts = spacecraft.NearGoalStarts(share=0.75, steps=64)
    drawn = jax.vmap(starts, (0, None))(jax.random.split(jax.random.key(0), n), params)
    near = np.asarray(drawn.time) == 500 - 64
    assert near.mean() == pytest.approx(0.75, abs=5 * np.sqrt(0.75 * 0.25 / n))
    angle = np.asarray(jax.vmap(quaternions.error_angle)(drawn.quaternion))
    rate = np.linalg.norm(drawn.angular_velocity, axis=1)
    # log10 is uniform: from −6 to 0 of the angle, from −5 to 0 of the rate over half its limit.
    for x, decades in ((angle[near], 6), (rate[near] / 0.25, 5)):
        counts, _ = np.histogram(np.log10(x), np.linspace(-decades, 0, decades + 1))
        expected = near.sum() / decades
        np.testing.assert_allclose(counts, expected, atol=5 * np.sqrt(expected))
    assert abs(np.corrcoef(np.log(angle[near]), np.log(rate[near]))[0, 1]) < 5 / np.sqrt(n)
    # The others are the paper's.
    assert np.all(drawn.time[~near] == 0) and np.all(rate[~near] == 0)
    assert np.rad2deg(angle[~near].min()) > 29.9 and np.rad2deg(angle[~near].mean()) > 89


def test_near_goal_starts_never_mark_a_whole_episode():
    params = spacecraft.default_params().replace(max_steps_in_episode=jnp.int32(10))
    starts = spacecraft.NearGoalStarts(share=0.999, steps=64)
    times = jax.vmap(starts, (0, None))(jax.random.split(jax.random.key(0), 50), params).time
    assert set(times.tolist()) == {1}


@pytest.mark.parametrize("frameskip, steps", [(20, 500), (5, 1750), (7, 1312), (0, 10_500)])
def test_episodes_last_43_75_seconds(frameskip, steps):
    assert spacecraft.default_params(frameskip).max_steps_in_episode == steps


def test_step_vmapped_equals_single_steps():
    n = 32
    batch = states(n)
    actions = jnp.arange(n) % 19
    together = jax.jit(jax.vmap(attjax.step))(batch, actions)
    single = jax.jit(attjax.step)
    for i in range(n):
        alone = single(jax.tree.map(lambda x, i=i: x[i], batch), actions[i])
        np.testing.assert_allclose(together.quaternion[i], alone.quaternion, atol=2e-7)
        np.testing.assert_allclose(together.angular_velocity[i], alone.angular_velocity, atol=1e-8)
        assert together.time[i] == alone.time == 1


def test_each_action_kicks_its_axis():
    rest = attjax.EnvState(jnp.array([0.0, 0, 0, 1]), jnp.zeros(3), jnp.int32(0))
    after = jax.jit(jax.vmap(attjax.step, (None, 0)))(rest, jnp.arange(19))
    expected = np.array(LM50.torque_table) / 240 / np.array([0.872, 0.115, 0.797])
    np.testing.assert_allclose(after.angular_velocity, expected, rtol=1e-5, atol=1e-9)


def test_full_inertia_gives_the_same_step_as_its_diagonal(x64):
    params = attjax.AttitudeEnv().default_params
    full = params.replace(inertia=jnp.diag(params.inertia))
    start = states(1).replace(angular_velocity=jnp.array([[0.1, -0.2, 0.3]]))
    start = jax.tree.map(lambda x: x[0], start)
    a = attjax.step(start, 3, params=params)
    b = attjax.step(start, 3, params=full)
    np.testing.assert_allclose(a.quaternion, b.quaternion, atol=1e-15)
    np.testing.assert_allclose(a.angular_velocity, b.angular_velocity, atol=1e-15)


def test_float64_throughout_when_enabled(x64):
    start = jax.tree.map(lambda x: x[0], states(1))
    after = attjax.step(start, 1)
    assert start.quaternion.dtype == after.quaternion.dtype == jnp.float64
    assert after.angular_velocity.dtype == jnp.float64
    assert after.time.dtype == jnp.int32
