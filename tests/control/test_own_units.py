"""A spacecraft's own units: what near the goal is the same for all, and which axes and torques."""

import dataclasses
import itertools

import jax.numpy as jnp
import numpy as np
import pytest
from helpers.own_units import KINDS, PULSES, SKEW, context_of, renamed

from attjax import LM50, AttitudeEnv, EnvState, Spacecraft, step
from attjax.control import torque_order, universal
from attjax.control.own_units import OwnUnits

ACTIONS = [(level, axis, sign) for level in range(3) for axis in range(3) for sign in (1, -1)]


@KINDS
def test_the_largest_impulse_adds_one_about_its_axis(x64, craft):
    context = context_of(craft)
    units = OwnUnits.of(context)
    inertia = np.asarray(context.inertia)
    tensor = np.diag(inertia) if inertia.ndim == 1 else inertia
    impulses = np.asarray(context.torque_table)[1:] * float(context.torque_duration)
    momenta = np.linalg.solve(tensor, impulses.T).T @ np.asarray(units.momentum).T
    shares = np.array(craft.torque_levels) / craft.torque_levels[0]
    expected = [sign * shares[level] * np.eye(3)[axis] for level, axis, sign in ACTIONS]
    np.testing.assert_allclose(momenta, expected, atol=1e-12)
    np.testing.assert_allclose(units.levels, shares[1:])
    axes = np.array(craft.torque_axes, float)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    np.testing.assert_allclose(units.directions, axes)
    impulse = craft.torque_levels[0] * float(context.torque_duration)
    onto = np.linalg.inv(axes.T)
    np.testing.assert_allclose(units.shape, onto @ tensor @ onto.T / impulse, rtol=1e-12)


@pytest.mark.parametrize("frameskip", [5, 20])
@KINDS
def test_near_the_goal_every_spacecraft_is_the_same(x64, craft, frameskip):
    """z grows by the momentum after the action, be it a pulse or held, at every rate."""
    env = AttitudeEnv(frameskip, spacecraft=craft)
    params = env.default_params
    numbers = universal.Universal.of(env.context(params))

    def own(state):
        z = numbers.of_vector @ state.quaternion[:3] + numbers.of_rate @ state.angular_velocity
        return np.asarray(z), np.asarray(numbers.momentum @ state.angular_velocity)

    scale = 1e-6
    near = EnvState(jnp.array([2e-6, -1e-6, 3e-6, 1.0]), scale * jnp.array([1.0, 2.0, -1.0]), 0)
    weak = params.replace(torque_table=params.torque_table * scale)
    for action, (level, axis, sign) in enumerate(ACTIONS, 1):
        (z, p), (later_z, later_p) = own(near), own(step(near, action, weak, frameskip))
        share = craft.torque_levels[level] / craft.torque_levels[0]
        kicked = p + scale * sign * share * np.eye(3)[axis]
        np.testing.assert_allclose(later_p, kicked, atol=1e-4 * scale)
        np.testing.assert_allclose(later_z, z + kicked, rtol=1e-5, atol=1e-4 * abs(kicked).max())


@pytest.mark.parametrize("signs", list(itertools.product((1, -1), repeat=3)))
def test_an_action_turned_back_is_the_one_that_was_meant(signs):
    """The best of the network's outputs acts forward; about axes called backward it acts back."""
    context = torque_order.ordered(context_of(SKEW))
    backward = np.array([signs]) < 0
    for action in range(torque_order.ACTIONS):
        outputs = np.arange(torque_order.ACTIONS) == action
        place = np.argmax(torque_order.turned_back(jnp.asarray(outputs[:, None]), backward)[:, 0])
        units = OwnUnits.of(context)
        meant, done = (
            units.momentum @ np.linalg.solve(_tensor(context), context.torque_table[n])
            for n in (action, place)
        )
        np.testing.assert_allclose(done, np.array(signs) * meant, rtol=1e-5, atol=1e-4)


def _tensor(context):
    return np.asarray(context.inertia)


def test_axes_are_in_order(x64):
    for craft in (LM50, PULSES, SKEW, *list(renamed(PULSES))[:8]):
        context = torque_order.ordered(context_of(craft))
        units = OwnUnits.of(context)
        shape = np.asarray(units.shape)
        assert np.all(np.diff(np.diagonal(shape)) > 0)
        assert units.hand == np.sign(np.linalg.det(units.directions))
        np.testing.assert_array_equal(torque_order.rows(context), np.arange(torque_order.ACTIONS))


def test_a_spacecraft_in_order_flies_by_the_same_torques(x64):
    few = [Spacecraft(torque_levels=x) for x in ((0.4,), (0.4, 0.01), (0.3, 0.3, 0.1))]
    for craft in (LM50, SKEW, Spacecraft(torque_levels=(0.01, 0.4, 0.1, 0.02)), *few):
        context, same = context_of(craft), context_of(torque_order.in_order(craft))
        chosen = context.torque_table[torque_order.rows(context)]
        np.testing.assert_allclose(same.torque_table, chosen, atol=1e-15)
        np.testing.assert_array_equal(torque_order.rows(same), np.arange(torque_order.ACTIONS))


def test_what_is_in_order_stays_in_it_where_moments_are_equal():
    """In float32, by whose rounding no axis comes before another."""
    rng = np.random.default_rng(0)
    for _ in range(60):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0].tolist()
        ball = Spacecraft(inertia=(rng.uniform(0.5, 2),) * 3, torque_axes=axes)
        rows = torque_order.rows(context_of(torque_order.in_order(ball)))
        np.testing.assert_array_equal(rows, np.arange(torque_order.ACTIONS))


@pytest.mark.parametrize(
    ("levels", "chosen"),
    [
        ((0.4,), (0.4, 0.4, 0.4)),
        ((0.01, 0.4), (0.4, 0.01, 0.01)),
        ((0.01, 0.4, 0.02), (0.4, 0.02, 0.01)),
        ((0.3, 0.001, 0.2, 0.02, 0.002), (0.3, 0.02, 0.001)),
        ((0.4, 0.02, 0.0), (0.4, 0.02, 0.02)),
        ((0.4, 0.02, 1e-6), (0.4, 0.02, 0.02)),
        ((0.0, 0.4, 0.0), (0.4, 0.4, 0.4)),
        ((0.3, 0.0, 0.2, 0.02, 0.002), (0.3, 0.02, 0.002)),
    ],
)
def test_three_levels_are_chosen(levels, chosen):
    """Those that have been identified to be dead are none of them."""
    table = Spacecraft(torque_levels=[1.0] * len(levels)).torque_table
    table = np.array(table) * np.append([0], np.repeat(levels, 6))[:, None]
    context = dataclasses.replace(context_of(LM50), torque_table=jnp.asarray(table, jnp.float32))
    context = torque_order.ordered(context)
    sizes = np.linalg.norm(context.torque_table, axis=1)
    np.testing.assert_allclose(sizes, [0, *np.repeat(chosen, 6)], rtol=1e-6)


def test_spacecraft_without_three_axes_are_refused(as_users_run):
    four = Spacecraft(torque_axes=((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)))
    flat = Spacecraft(torque_axes=((1, 0, 0), (0, 1, 0), (1, 1, 0)))
    with pytest.raises(ValueError, match="LM50 has 4 torque_axes; universal inputs are for 3"):
        torque_order.check_axes(four)
    with pytest.raises(ValueError, match="LM50 has torque_axes in a plane"):
        torque_order.check_axes(flat)
    with pytest.raises(ValueError, match="the spacecraft has 9 actions; they must be of 3 axes"):
        torque_order.rows(
            context_of(Spacecraft(torque_levels=(0.1,), torque_axes=four.torque_axes))
        )
    torque_order.check_axes(SKEW)
