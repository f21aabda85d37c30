import jax
import jax.numpy as jnp
import numpy as np
import pytest

import attjax
from attjax import AttitudeEnv
from attjax.dynamics import quaternion as quaternions
from attjax.envs import initial_state, parameters
from attjax.spacecraft import LM50

pytestmark = pytest.mark.usefixtures("strict_promotion")


def states(n, seed=0):
    params = parameters.default_params()
    keys = jax.random.split(jax.random.key(seed), n)
    return jax.vmap(initial_state.initial_state, (0, None))(keys, params)


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
    params = parameters.default_params()
    starts = initial_state.NearGoalStarts(share=0.75, steps=64)
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
    params = parameters.default_params().replace(max_steps_in_episode=jnp.int32(10))
    starts = initial_state.NearGoalStarts(share=0.999, steps=64)
    times = jax.vmap(starts, (0, None))(jax.random.split(jax.random.key(0), 50), params).time
    assert set(times.tolist()) == {1}


@pytest.mark.parametrize("frameskip, steps", [(20, 500), (5, 1750), (7, 1312), (0, 10_500)])
def test_episodes_last_43_75_seconds(frameskip, steps):
    assert parameters.default_params(frameskip).max_steps_in_episode == steps


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


def uniforms(direction):
    """The two uniform numbers that a direction (n, 3) was made of: z and the azimuth."""
    x, y, z = np.asarray(direction, np.float64).T
    return [(z + 1) / 2, np.arctan2(y, x) / (2 * np.pi) % 1]


def test_near_goal_starts_are_made_of_independent_uniform_numbers():
    """Each quantity is uniform after its inverse distribution function, and no two are related."""
    n = 100_000
    params = parameters.default_params()
    starts = initial_state.NearGoalStarts(share=0.5, steps=64)
    drawn = jax.vmap(starts, (0, None))(jax.random.split(jax.random.key(0), n), params)
    near = np.asarray(drawn.time) > 0
    angle = np.asarray(jax.vmap(quaternions.error_angle)(drawn.quaternion))
    axis = np.asarray(drawn.quaternion)[:, :3] / np.sin(angle / 2)[:, None]
    rate = np.linalg.norm(drawn.angular_velocity, axis=1)
    heading = np.asarray(drawn.angular_velocity)[near] / rate[near, None]
    decades = [-np.log10(angle[near]) / 6, -np.log10(rate[near] / 0.25) / 5]
    degrees = np.rad2deg(angle[~near])
    for numbers in (
        [*decades, *uniforms(axis[near]), *uniforms(heading)],
        [*uniforms(axis[~near]), (degrees - 30) / 120],
    ):
        count = len(numbers[0])
        for x in numbers:
            counts, _ = np.histogram(x, np.linspace(0, 1, 11))
            np.testing.assert_allclose(counts, count / 10, atol=5 * np.sqrt(0.09 * count))
            np.testing.assert_allclose([min(x), max(x)], [0, 1], atol=1e-3)
        related = np.corrcoef(numbers) - np.eye(len(numbers))
        assert np.abs(related).max() < 5 / np.sqrt(count)


def test_a_share_of_none_is_none(monkeypatch):
    """Though the number that decides may be 0."""
    monkeypatch.setattr(jax.random, "uniform", lambda key, shape, dtype: jnp.zeros(shape, dtype))
    none = initial_state.NearGoalStarts(share=0.0, steps=64)
    start = none(jax.random.key(0), parameters.default_params())
    assert not start.angular_velocity.any() and start.time == 0
    assert hash(none) == hash(
        initial_state.NearGoalStarts(share=0.0, steps=64)
    )  # a static argument


def test_an_environment_says_which_episodes_are_whole():
    """Those that start at rest, of full length; none of those that start near the goal."""
    for steps in (64, 10_000):  # longer than an episode, too
        starts = initial_state.NearGoalStarts(share=0.5, steps=steps)
        env = AttitudeEnv(frameskip=20, initial_state=starts)
        keys = jax.random.split(jax.random.key(0), 200)
        states = jax.vmap(env.reset, (0, None))(keys, env.default_params)[1]
        whole = env.starts_whole(states)
        assert whole.dtype == bool and 50 < whole.sum() < 150
        np.testing.assert_array_equal(whole, ~states.angular_velocity.any(axis=1))


def test_parameters_may_be_arguments_of_a_jitted_step():
    """All but torque_held are traced; what is left out of them is the paper's."""
    whole = parameters.default_params(20)
    names = [f for f in whole.__dataclass_fields__ if f not in ("frameskip", "torque_held")]
    params = attjax.EnvParams(**{name: getattr(whole, name) for name in names})
    assert params.frameskip is None and params.torque_held is False
    start = jax.tree.map(lambda x: x[0], states(1))
    after = jax.jit(attjax.step, static_argnames="frameskip")(start, 1, params)
    held = jax.jit(attjax.step)(start, 1, params.replace(torque_held=True))
    kick = 0.5 / 240 / 0.872
    assert float(after.angular_velocity[0]) == pytest.approx(kick, rel=1e-5)
    assert float(held.angular_velocity[0]) == pytest.approx(21 * kick, rel=1e-4)
    default = parameters.default_params()
    jax.tree.map(np.testing.assert_array_equal, default, whole)


@pytest.mark.parametrize(
    "name, allowed, refused, wrong",
    [
        ("inertia", [1.0, 1.0, 2.0], [1.0, 1.0, 2.1], "inertia has principal moments"),
        ("torque_table", np.ones((2, 3)), np.ones((2, 2)), "must be (n, 3)"),
        ("rate_limit", 0.5, 0.0, "rate_limit is 0; it must be above 0"),
        ("rate_limit", 1e-3, -0.5, "rate_limit is -0.5; it must be above 0"),
        ("goal_angle", 0.5, 0.0, "goal_angle is 0; it must be above 0"),
        ("goal_angle", 1e-3, -0.5, "goal_angle is -0.5; it must be above 0"),
        ("min_slew_angle", 0.0, -0.1, "min_slew_angle is -0.1; it must be at least 0"),
        ("max_slew_angle", np.pi / 6, 0.5, "max_slew_angle is 0.5; it must be at least 0.52359"),
        ("max_steps_in_episode", 1, 0, "it must be from 1 to 2147483647"),
        ("max_steps_in_episode", 2**31 - 1, -1, "it must be from 1 to 2147483647"),
        ("frameskip", 0, -1, "params.frameskip is -1; it must be from 0 to 20"),
        ("frameskip", 20, 21, "params.frameskip is 21; it must be from 0 to 20"),
        ("torque_held", True, 1, "params.torque_held is 1; it must be True or False"),
        ("torque_held", False, None, "params.torque_held is None; it must be True or False"),
    ],
)
def test_parameters_at_the_edge_pass_and_beyond_it_are_refused(name, allowed, refused, wrong):
    params = parameters.default_params()
    parameters.check_params(params.replace(**{name: allowed}), 20)
    with pytest.raises(ValueError) as error:
        parameters.check_params(params.replace(**{name: refused}), 20)
    assert wrong in str(error.value)


def test_a_step_outside_jit_compiles_once(caplog):
    """And not again for other states, actions and parameters."""
    starts = [jax.tree.map(lambda x, row=row: x[row], states(3)) for row in range(3)]
    params = parameters.default_params(31)
    heavier = params.replace(inertia=params.inertia * 2)

    def compiled():
        return [record.getMessage() for record in caplog.records if "ompil" in record.getMessage()]

    with jax.log_compiles():
        attjax.step(starts[0], 1, params, 31)
        first = compiled()
        attjax.step(starts[1], 2, params, 31)
        attjax.step(starts[2], 18, heavier, 31)
    assert len(first) >= 1 and compiled() == first


def test_an_action_beyond_the_table_is_refused():
    start = jax.tree.map(lambda x: x[0], states(1))
    for action in (0, 18):
        attjax.step(start, action)
    for action in (-1, 19):
        with pytest.raises(ValueError, match=f"action is {action}; it must be from 0 to 18"):
            attjax.step(start, action)
