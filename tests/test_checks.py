"""Arrays that users hand in: one line that names the array and what is allowed."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv, EnvState, Spacecraft, checks, dynamics, step
from attjax.control import classical
from attjax.envs import batch
from attjax.ppo.networks import Policy

ENV = AttitudeEnv(frameskip=5)
CONTINUOUS = AttitudeEnv(frameskip=5, actions="continuous")
PARAMS = ENV.default_params
GOAL = EnvState(jnp.array([0.0, 0, 0, 1]), jnp.zeros(3), 0)


def message(function, *arguments):
    with pytest.raises(ValueError) as error:
        function(*arguments)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    "field, value, expected",
    [
        ("quaternion", jnp.array([0.0, 0, 0, 2]), "quaternion has length 2; it must be 1"),
        (
            "quaternion",
            jnp.array([0.0, 0, 0, np.nan]),
            "nan]; it must be finite",
        ),
        ("quaternion", jnp.array([0.0, 0, 1]), "quaternion has shape (3,); it must be (4,)"),
        (
            "quaternion",
            jnp.array([0, 0, 0, 1]),
            "has type int32; it must be floating-point",
        ),
        ("quaternion", "north", "quaternion is str; it must be an array of numbers"),
        ("angular_velocity", jnp.array([0.0, np.inf, 0]), "angular_velocity is [ 0. inf 0.]"),
        ("angular_velocity", jnp.zeros(2), "angular_velocity has shape (2,); it must be (3,)"),
    ],
)
def test_states(field, value, expected):
    state = GOAL.replace(**{field: value})
    assert expected in message(step, state, 0)
    assert expected in message(ENV.step, jax.random.key(0), state, 0, PARAMS)


@pytest.mark.parametrize(
    "action, expected",
    [
        (19, "action is 19; it must be from 0 to 18"),
        (-1, "action is -1; it must be from 0 to 18"),
        (1.5, "action has type float32; it must be an integer"),
        ([1, 2], "action has shape (2,); it must be ()"),
        (None, "action"),
    ],
)
def test_actions(action, expected):
    assert expected in message(step, GOAL, action)
    assert expected in message(ENV.step_env, jax.random.key(0), GOAL, action, PARAMS)


@pytest.mark.parametrize(
    "action, expected",
    [
        ([0.5, 0.5], "action has shape (2,); it must be (3,)"),
        ([0.5, np.nan, 0], "nan 0. ]; it must be finite"),
        (np.zeros((3, 3)), "action has shape (3, 3); it must be (3,)"),
        (0.5, "action has shape (); it must be (3,)"),
        (1, "action has type int32; it must be floating-point"),
        ([1, 0, 0], "action has type int32; it must be floating-point"),
        ("up", "action is str; it must be an array of numbers"),
    ],
)
def test_continuous_actions(action, expected):
    arguments = jax.random.key(0), GOAL, action, PARAMS
    assert expected in message(CONTINUOUS.step_env, *arguments)
    assert expected in message(CONTINUOUS.step, *arguments)


def test_a_step_says_both_that_an_action_may_be():
    for action, shape in ((1.5, "()"), ([0.5, 0.5], "(2,)")):
        expected = f"it must be an integer, or have shape (3,) and not {shape}"
        assert message(step, GOAL, action) == f"action has type float32; {expected}"
    assert "it must be finite" in message(step, GOAL, [0.0, np.inf, 0.0])
    assert "must be an integer" in message(ENV.step_env, None, GOAL, np.zeros(3), PARAMS)
    with pytest.raises(ValueError, match="it must be an integer"):
        jax.jit(jax.vmap(ENV.step_env, (None, None, 0, None)))(None, GOAL, np.zeros((2, 3)), PARAMS)


def test_kinds_of_actions_and_axes_that_have_none():
    for kind in ("Continuous", None, 3, True, np.zeros(2), ["discrete"]):
        expected = "it must be 'discrete' or 'continuous'"
        assert expected in message(lambda kind: AttitudeEnv(actions=kind), kind)
    skew = Spacecraft(torque_axes=((1, 0, 0), (0, 1, 1)))
    assert AttitudeEnv(spacecraft=skew).num_actions == 13
    expected = "in row 3; for continuous actions each torque must be along a body axis"
    assert expected in message(lambda: AttitudeEnv(spacecraft=skew, actions="continuous"))
    params = AttitudeEnv(spacecraft=skew).default_params
    assert expected in message(step, GOAL, np.zeros(3), params)
    for axis in ((1, 1e-7, 0), (0, 0, -2)):  # but for rounding, along one
        AttitudeEnv(spacecraft=Spacecraft(torque_axes=(axis,)), actions="continuous")


@pytest.mark.parametrize(
    "field, value, expected",
    [
        ("inertia", [1.0, 0, 1], "principal moments [0. 1. 1.]; they must be positive"),
        ("inertia", [1.0, -1, 1], "they must be positive"),
        ("inertia", [1.0, 1, 2.1], "1, 1, 2.1; none may exceed the other two together"),
        ("inertia", np.eye(3) + np.eye(3, k=1) / 9, "it must be symmetric"),
        ("inertia", np.diag([1.0, 1, 3]), "1, 1, 3; none may exceed"),
        ("inertia", [1.0, np.nan, 1], "it must be finite"),
        ("inertia", np.ones((3, 2)), "inertia has shape (3, 2); it must be (3,) or (3, 3)"),
        ("rate_limit", 0.0, "rate_limit is 0; it must be above 0"),
        ("goal_angle", -1.0, "goal_angle is -1; it must be above 0"),
        ("max_slew_angle", 0.1, "max_slew_angle is 0.1; it must be at least 0.5235"),
        ("max_steps_in_episode", np.int32(0), "max_steps_in_episode is 0; it must be from 1"),
        ("max_steps_in_episode", 5.0, "max_steps_in_episode has type float32"),
        ("torque_table", np.zeros((19, 2)), "torque_table has shape (19, 2); it must be (n, 3)"),
        ("frameskip", np.int32(6), "params.frameskip is 6; it must be from 0 to 5"),
    ],
)
def test_parameters(field, value, expected):
    value = value if isinstance(value, np.integer) else np.asarray(value, np.float32)
    params = PARAMS.replace(**{field: value})
    assert expected in message(ENV.reset, jax.random.key(0), params)
    assert expected in message(ENV.step, jax.random.key(0), GOAL, 0, params)
    assert expected in message(step, GOAL, 0, params, 5)


def test_observations_of_controllers_and_policies(as_users_run):
    context, short = ENV.context(PARAMS), jnp.zeros(7)
    policy = Policy("multiscale", (8,))
    params = policy.init(jax.random.key(0), jax.random.key(1), jnp.zeros(11), context)
    expected = "observation has shape (7,); it must be (11,)"
    assert expected in message(policy.act, params, short, context)
    for controller in classical.CONTROLLERS.values():
        assert expected in message(controller, short, context)


def test_batches_of_the_fused_rollout():
    _, states = jax.vmap(ENV.reset)(jax.random.split(jax.random.key(0), 4))
    for actions, devices, expected in (
        (np.zeros(4, int), 1, "actions has shape (4,)"),
        (np.zeros((3, 4)), 1, "it must be (steps, batch) integers or (steps, batch, 3) real"),
        (np.zeros((3, 4, 2)), 1, "it must be (steps, batch) integers or (steps, batch, 3) real"),
        (np.zeros((3, 4, 3), int), 1, "actions has shape (3, 4, 3) and type int32"),
        (np.zeros((3, 4, 3)), 1, "action has type float32; it must be an integer"),
        (np.zeros((3, 5), int), 1, "states has leading axes [(4,)]; they must be (5,)"),
        (np.zeros((3, 4), int), 3, "num_devices is 3; it must be a divisor"),
        (np.zeros((3, 4), int), 0, "num_devices is 0"),
    ):
        arguments = ENV, PARAMS, jax.random.key(1), states, actions, devices
        assert expected in message(batch.open_loop, *arguments)


def test_bodies_at_the_edge_of_what_is_possible_are_accepted():
    """A flat plate's largest moment is the sum of the others, whatever the rounding."""
    for moments in ([0.1, 0.2, 0.3], [0.872, 0.115, 0.987], [1.0, 1.0, 1.0]):
        inertia = jnp.array(moments, jnp.float32)
        dynamics.rk4_step(GOAL.quaternion, GOAL.angular_velocity, jnp.zeros(3), inertia)


def test_inside_jit_and_vmap_shapes_and_types_are_checked():
    states = jax.tree.map(lambda x: jnp.stack([jnp.asarray(x)] * 2), GOAL)
    wrong = states.replace(angular_velocity=jnp.zeros((2, 2)))
    assert "angular_velocity has shape (2,)" in message(
        jax.jit(jax.vmap(step)), wrong, np.ones(2, int)
    )
    flown = jax.jit(jax.vmap(step))(states, np.array([18, 99]))
    np.testing.assert_array_equal(flown.angular_velocity[0], flown.angular_velocity[1])


@pytest.mark.parametrize("action", [0, 18, np.int64(3), np.array(3)])
def test_actions_from_python_pass(action):
    assert checks.action(action, 19) == int(action)
    passed = checks.actions([action, 0], 2, 19)
    assert passed.dtype == np.int32 and passed.tolist() == [int(action), 0]


@pytest.mark.parametrize("action", [-1, 19, 0.5, None, "up", [1, 2]])
def test_actions_from_python_are_refused_in_one_line(action):
    with pytest.raises(ValueError, match=r"^action is .*; it must be [^\n]*$"):
        checks.action(action, 19)
    with pytest.raises(ValueError, match=r"^actions (has|holds) .*; (it|each) must be [^\n]*$"):
        checks.actions([action] if np.ndim(action) == 0 else action, 1, 19)


def test_descriptions_and_arrays_refuse_a_moment_in_the_same_words():
    """And what a description may be passes in single precision, too."""
    for inertia in ((1, 1, 2 + 4e-5), ((1, 0, 0), (0, 3, 0), (0, 0, 1))):
        described = message(lambda inertia: Spacecraft(inertia=inertia), inertia)
        assert described == message(checks.inertia, jnp.array(inertia, float))
        assert "none may exceed the other two together" in described
    edge = Spacecraft(inertia=(1, 1, 2 + 1.8e-6)).inertia
    checks.inertia(jnp.array(edge, float))
