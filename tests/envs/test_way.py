"""How far it is to the goal by turns about two axes alone: never more than a way that is known."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attjax import LM50, AttitudeEnv
from attjax.envs import way
from attjax.envs.reward import REWARDS, Transition

AXES = np.eye(3)


def table_without(axis):
    table = np.array(LM50.torque_table)
    table[:, axis] = 0
    return jnp.asarray(table, jnp.float32)


def after(turns, axes):
    """The attitude after turns about the axes of the body, one after the other; −q is not q."""
    vector, scalar = np.zeros(3), 1.0
    for angle, axis in zip(turns, itertools.cycle(axes)):
        turned, kept = np.sin(angle / 2) * AXES[axis], np.cos(angle / 2)
        vector, scalar = (
            kept * vector + scalar * turned + np.cross(vector, turned),
            kept * scalar - vector @ turned,
        )
    return jnp.asarray(np.append(vector, scalar), jnp.float32)


@pytest.mark.parametrize("dead", range(3))
def test_no_way_that_is_known_is_shorter(dead):
    """Of one to five turns; of large ones a few are. The least are found to within 3 percent."""
    rng, table = np.random.default_rng(dead), table_without(dead)
    length = jax.jit(jax.vmap(lambda q: way.angle_to_turn(q, table)))
    live = [axis for axis in range(3) if axis != dead]
    for size in (0.01, 0.1, 0.3, 1.0):
        ways = [size * rng.normal(size=rng.integers(1, 6)) for _ in range(500)]
        ends = [after(turns, live[:: rng.choice([1, -1])]) for turns in ways]
        shares = np.asarray(length(jnp.stack(ends))) / [np.sum(np.abs(x)) for x in ways]
        assert shares.max() < 1.03 or (size == 1 and np.mean(shares > 1.03) < 0.01)
        assert np.mean(shares > 0.97) > 0.3 and np.mean(shares) > 0.8


@pytest.mark.parametrize("dead", range(3))
def test_closed_forms(dead):
    table, live = table_without(dead), [axis for axis in range(3) if axis != dead]
    assert float(way.angle_to_turn(after([], live), table)) < 1e-6
    for axis, angle in itertools.product(live, (-2.0, -1e-3, 0.7)):
        found = way.angle_to_turn(after([angle], [axis]), table)
        assert float(found) == pytest.approx(abs(angle), rel=1e-3)
    for angle in (-2.5, 2.0):  # about the dead axis: there and back about another
        found = way.angle_to_turn(after([angle], [dead]), table)
        assert float(found) == pytest.approx(abs(angle) + np.pi, rel=1e-3)
    once = way.angle_to_turn(jnp.array([0.0, 0.0, 0.0, -1.0]), table)  # once round, as φ is 360°
    assert float(once) == pytest.approx(2 * np.pi, rel=1e-4)
    small = way.angle_to_turn(after([1e-4], [dead]), table)
    assert float(small) == pytest.approx(4 * 1e-4**0.5, rel=0.01)


def test_a_square_turns_about_the_third_axis():
    """By its area: the other way round, the other way; and there is no shorter way."""
    table = table_without(2)
    for turns in ((0.02, 0.02, -0.02, -0.02), (0.02, -0.02, -0.02, 0.02)):
        end = after(turns, (0, 1))
        assert abs(float(2 * end[2])) == pytest.approx(4e-4, rel=0.02)
        assert float(way.angle_to_turn(end, table)) == pytest.approx(0.08, rel=0.02)


def test_with_three_axes_it_is_the_error_angle():
    table = jnp.asarray(LM50.torque_table, jnp.float32)
    for rotation in Rotation.random(20, random_state=0):
        q = rotation.as_quat()
        found = way.angle_to_turn(jnp.asarray(q, jnp.float32), table)
        assert float(found) == pytest.approx(2 * np.arccos(q[3]), rel=1e-4)
    weak = table.at[:, 1].multiply(2 * way.DEAD)
    assert not np.any(way.dead_axes(weak))
    np.testing.assert_array_equal(way.dead_axes(table_without(1)), [False, True, False])


def test_the_reward_is_of_that_angle_and_the_logarithmic_one_elsewhere():
    rest = jnp.zeros(3)
    for rotation in Rotation.random(10, random_state=1):
        q = jnp.asarray(rotation.as_quat(canonical=True), jnp.float32)
        step = Transition(q, q, rest, False, False, 0.004, 0.05, rest, jnp.array(LM50.torque_table))
        assert REWARDS["way"](step) == REWARDS["logarithmic"](step)
        two = step._replace(torque_table=table_without(0))
        angle = float(way.angle_to_turn(q, table_without(0)))
        assert float(REWARDS["way"](two)) == pytest.approx(-2 * np.log10(angle + 1e-4), rel=1e-4)
        assert float(REWARDS["way"](two._replace(terminated=True))) == -50
    with pytest.raises(ValueError, match="torque_table is None"):
        REWARDS["way"](step._replace(torque_table=None))


def test_an_environment_tells_the_reward_of_its_torques():
    told = []

    def reward(transition):
        told.append(transition.torque_table)
        return jnp.zeros(())

    env = AttitudeEnv(5, reward=reward)
    params = env.default_params
    _, state = env.reset(jax.random.key(0), params)
    env.step_env(jax.random.key(1), state, 0, params)
    np.testing.assert_array_equal(told[0], params.torque_table)
