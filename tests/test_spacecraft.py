"""A user's own spacecraft."""

import tomllib

import hypothesis
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import rotated_inertia
from hypothesis import strategies as st

import attjax
from attjax import AttitudeEnv, Spacecraft, evaluation
from attjax import spacecraft as specification
from attjax.config import toml
from attjax.config.presets import PAPER
from attjax.config.run import Config
from attjax.control import assurance, classical, time_optimal
from attjax.evaluation import paper
from attjax.spacecraft import LM50

CUBESAT = Spacecraft(
    name="CubeSat",
    inertia=(0.05, 0.144, 0.174),
    torque_levels=(2e-3, 2e-4, 2e-5),
    torque_held=True,
    rate_limit=0.1,
    duration=90.0,
)


def test_actions_are_levels_about_axes_in_both_directions():
    spacecraft = Spacecraft(torque_levels=(2, 1), torque_axes=((0, 3, 4), (1, 0, 0)))
    first = [[0, 0, 0], [0, 1.2, 1.6], [0, -1.2, -1.6], [2, 0, 0], [-2, 0, 0], [0, 0.6, 0.8]]
    np.testing.assert_allclose(spacecraft.torque_table[:6], first)
    assert spacecraft.num_actions == len(spacecraft.torque_table) == 9
    assert LM50.num_actions == 19


def test_lists_and_arrays_will_do():
    given = Spacecraft(inertia=rotated_inertia(), torque_levels=[np.float64(0.5)])
    assert given == Spacecraft(inertia=rotated_inertia().tolist(), torque_levels=(0.5,))
    assert hash(AttitudeEnv(5, spacecraft=given)) == hash(AttitudeEnv(5, spacecraft=given))


def test_episodes_are_whole_agent_steps_of_the_duration():
    assert [LM50.max_steps(frameskip) for frameskip in (5, 20)] == [1750, 500]
    assert CUBESAT.max_steps(23) == 900
    assert LM50.most_frameskip == 10_499 and LM50.max_steps(10_499) == 1
    with pytest.raises(ValueError, match="frameskip is 300; it must be an integer from 0 to 239"):
        AttitudeEnv(300, spacecraft=Spacecraft(duration=1.0))


def test_parameters_are_as_described():
    env = AttitudeEnv(frameskip=23, spacecraft=CUBESAT)
    params, context = env.default_params, env.context(env.default_params)
    np.testing.assert_allclose(params.inertia, CUBESAT.inertia, rtol=1e-6)
    assert params.rate_limit == np.float32(0.1) and params.max_steps_in_episode == 900
    assert float(params.goal_angle) == pytest.approx(np.deg2rad(0.25))
    assert context.torque_duration == context.control_period == pytest.approx(0.1)
    assert env.action_space(params).n == env.num_actions == 19
    lm50 = AttitudeEnv(23)
    assert lm50.context(lm50.default_params).torque_duration == 1 / 240


def test_a_held_torque_turns_a_cubesat_by_its_closed_form(x64):
    """From rest about a principal axis: angle U t²/2I, rate U t/I."""
    env = AttitudeEnv(frameskip=23, spacecraft=CUBESAT)
    state = paper.table_5_slews()
    start = jax.tree.map(lambda x: x[0], state).replace(quaternion=jnp.array([0.0, 0, 0, 1]))
    for _ in range(10):
        start = env.step_env(None, start, 1, env.default_params)[1]  # + 2 mN m about x
    rate = 2e-3 * 1.0 / 0.05
    np.testing.assert_allclose(start.angular_velocity, [rate, 0, 0], rtol=1e-9)
    np.testing.assert_allclose(start.quaternion[0], np.sin(rate / 4), rtol=1e-9)


def test_the_users_step_holds_the_torque_that_the_environment_holds(x64):
    env = AttitudeEnv(frameskip=23, spacecraft=CUBESAT)
    state = env.reset(jax.random.key(0), env.default_params)[1]
    expected = env.step_env(None, state, 3, env.default_params)[1]
    alone = attjax.step(state, 3, env.default_params, 23)
    jax.tree.map(np.testing.assert_array_equal, alone, expected)
    assert alone.angular_velocity[1] == pytest.approx(2e-3 * 0.1 / 0.144, rel=1e-6)
    pulsed = env.default_params.replace(torque_held=False)
    assert env.context(pulsed).torque_duration == 1 / 240
    after = env.step_env(None, state, 3, pulsed)[1]
    assert after.angular_velocity[1] == pytest.approx(2e-3 / 240 / 0.144, rel=1e-6)


@pytest.mark.parametrize("controller", classical.CONTROLLERS)
def test_classical_controllers_fly_a_cubesat_with_wheels(controller):
    env = AttitudeEnv(frameskip=23, spacecraft=CUBESAT)
    act = jax.tree_util.Partial(classical.CONTROLLERS[controller])
    flown = evaluation.fly(act, env, env.default_params, jax.random.key(0), 50)
    statistics = evaluation.statistics(flown, env, env.default_params)
    assert statistics["success_rate"] == 1 and statistics["overspeed_rate"] == 0
    # Wheels cannot give more than their largest torque all the time.
    assert statistics["impulse_N_m_s"]["max"] <= 2e-3 * 90


@pytest.mark.parametrize("inertia", [CUBESAT.inertia, tuple(map(tuple, rotated_inertia() / 5))])
def test_the_rate_mask_holds_with_held_torques(inertia):
    """A policy that takes the last action that is allowed, whatever it does."""
    spacecraft = Spacecraft(
        inertia=inertia, torque_levels=(0.01, 0.002), torque_held=True, rate_limit=0.2, duration=60
    )
    env = AttitudeEnv(frameskip=23, spacecraft=spacecraft)

    def wild(observation, context):
        allowed = assurance.rate_mask(context, 0.99).allowed(observation[8:])
        taste = jnp.sin(1e4 * observation[0] + jnp.arange(len(allowed)) ** 2)
        return jnp.argmax(jnp.where(allowed, taste, -2.0))

    act = jax.tree_util.Partial(wild)
    flown = evaluation.fly(act, env, env.default_params, jax.random.key(1), 200)
    assert not np.any(flown.overspeed)
    assert float(jnp.max(flown.terminal_rate)) > 0.15


def test_time_optimal_reference_needs_no_principal_axes(x64):
    """The same spacecraft and slew in other axes, along which the moments are no principal ones."""
    env = AttitudeEnv(frameskip=5)
    context = env.context(env.default_params)
    slew = jnp.array([0.0, np.sin(0.5), 0.0, np.cos(0.5)])
    tensor = context.replace(inertia=jnp.diag(context.inertia))
    expected = time_optimal.time_optimal_reference(slew, context)
    assert time_optimal.time_optimal_reference(slew, tensor) == pytest.approx(float(expected))


def test_a_file_is_read(tmp_path):
    path = tmp_path / "cube.toml"
    path.write_text("inertia = [[2, 0.1, 0], [0.1, 2, 0], [0, 0, 3]]\ntorque_levels = [1e-3]\n")
    spacecraft = attjax.Spacecraft.from_toml(path)
    assert (spacecraft.name, spacecraft.num_actions) == ("cube", 7)
    assert spacecraft.inertia == ((2, 0.1, 0), (0.1, 2, 0), (0, 0, 3))
    assert (spacecraft.rate_limit, spacecraft.duration) == (LM50.rate_limit, LM50.duration)


@pytest.mark.parametrize(
    "values, expected",
    [
        ({"inertia": [1, 2]}, r"inertia is \[1, 2\]; it must be 3 numbers"),
        ({"inertia": [[1, 0, 0], [0, 1, 0], [0, 0.1, 1]]}, "it must be symmetric"),
        ({"inertia": [1, 1, 3]}, "none may exceed the other two together"),
        ({"inertia": [1e-6, 1, 1]}, "the least must be at least 0.001 of the largest"),
        (
            {"inertia": [1e-9, 1e-9, 2e-9], "torque_levels": [463.0]},
            "which changes the rate by up to 1.93e.09 rad/s in 1/240 s; it must be at most rate_",
        ),
        ({"inertia": [10**400, 1, 1]}, "they must be finite"),
        ({"inertia": [-1, 1, 1]}, "principal moments -1, 1, 1; they must be from 1e-09 to 1e"),
        ({"inertia": [[float("nan"), 0, 0], [0, 1, 0], [0, 0, 1]]}, "they must be finite"),
        ({"torque_levels": []}, "it must be a list of numbers"),
        ({"torque_levels": [0.1, -0.1]}, "they must be from 1e-12 to 1e"),
        ({"torque_levels": [1] * 400}, "make 2401 actions; they must be at most 1000"),
        ({"torque_axes": [[0, 0, 0]]}, r"torque_axes holds \[0, 0, 0\]; it must be a direction"),
        ({"torque_axes": [1, 0, 0]}, "each of torque_axes is 1; it must be 3 numbers"),
        ({"torque_held": 1}, "torque_held is 1; it must be true or false"),
        ({"rate_limit": "fast"}, "rate_limit is 'fast'; it must be a number"),
        ({"rate_limit": True}, "rate_limit is True; it must be a number"),
        ({"goal_angle_deg": 0}, "goal_angle_deg is 0; it must be from 1e-06 to 180"),
        ({"slew_angles_deg": [20, 10]}, "the first must be the least"),
        ({"duration": 0.001}, "duration is 0.001; it must be from 0.00416667"),
        ({"name": "a\nb"}, "it must be a line of text"),
        ({"mass": 3}, "mass is unknown; there are name, inertia"),
        ([1], "it must be a table"),
    ],
)
def test_bad_descriptions(values, expected):
    with pytest.raises(ValueError, match=expected):
        specification.from_lists(values)


FASTEST = PAPER.replace(frameskips=(0,))
ODD = st.sampled_from([None, True, "x", [], {}, -1, 0, 1e-40, 1e40, 10**400, float("nan"), [[1]]])
THREE = st.lists(st.floats(-1e12, 1e12), min_size=3, max_size=3)
MOMENTS = st.lists(st.floats(1.0, 2.0), min_size=3, max_size=3)  # any three are a body's
SCALE = st.sampled_from([1e-9, 1e-4, 1.0, 4e8])
VALUES = {
    "inertia": st.one_of(
        st.builds(lambda moments, scale: [x * scale for x in moments], MOMENTS, SCALE),
        st.lists(THREE, min_size=3, max_size=3),
    ),
    "torque_levels": st.lists(st.floats(1e-12, 100), min_size=1, max_size=4),
    "torque_axes": st.lists(THREE, min_size=1, max_size=4),
    "torque_held": st.booleans(),
    "rate_limit": st.floats(1e-6, 100),
    "goal_angle_deg": st.floats(1e-6, 180),
    "slew_angles_deg": st.lists(st.floats(0, 180), min_size=2, max_size=2).map(sorted),
    "duration": st.floats(1 / 240, 1e6),
    "name": st.text(max_size=3),
}


@hypothesis.settings(max_examples=150, deadline=None)
@hypothesis.given(
    values=st.fixed_dictionaries({}, optional=VALUES),
    odd=st.dictionaries(st.sampled_from([*VALUES, "mass"]), ODD, max_size=1),
)
def test_any_description_is_flown_or_refused_in_a_line(values, odd):
    try:
        spacecraft = specification.from_lists(values | odd)
    except ValueError as error:
        assert "\n" not in str(error) and str(error)
        hypothesis.event("refused")
        return
    hypothesis.event("flown")
    env = AttitudeEnv(0, spacecraft=spacecraft)
    observation, state = env.reset(jax.random.key(0), env.default_params)
    after = env.step_env(None, state, env.num_actions - 1, env.default_params)[0]
    assert np.all(np.isfinite(observation)) and np.all(np.isfinite(after))
    again = tomllib.loads(toml.text(Config("paper", 0, FASTEST, spacecraft)))["spacecraft"]
    assert specification.from_lists(again) == spacecraft
