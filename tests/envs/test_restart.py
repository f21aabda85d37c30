"""New episodes in place of those that ended, of a batch and under vmap."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv
from attjax.envs import initial_state, restart

ENV = AttitudeEnv(frameskip=5)
PARAMS = ENV.default_params.replace(max_steps_in_episode=jnp.int32(3))
COUNT = 32
AXES = (0, 0, 0, None)


@pytest.mark.parametrize("by", [restart.restart, restart.restart_few, restart.restart_all])
@pytest.mark.parametrize("ended_count", [0, 1, 5, 23, 40])
def test_restart_replaces_all_that_ended_and_nothing_else(by, ended_count):
    """Whether fewer end than are drawn at a time, or all; as CPUs do it, and as others."""
    rows = jax.random.permutation(jax.random.key(0), 40)[:ended_count]
    ended = jnp.zeros(40, bool).at[rows].set(True)

    def reset(row):
        key = jax.random.fold_in(jax.random.key(2), row)
        return {"row": row, "number": jax.random.uniform(key), "vector": jnp.ones(3)}

    ongoing = {
        "row": jnp.full(40, -1),
        "number": jnp.full(40, 2.0),
        "vector": jnp.zeros((40, 3)),
    }
    after = jax.jit(by, static_argnums=0)(reset, ended, ongoing)
    np.testing.assert_array_equal(after["row"], jnp.where(ended, jnp.arange(40), -1))
    np.testing.assert_array_equal(after["number"] == 2.0, ~ended)
    np.testing.assert_array_equal(after["vector"], jnp.tile(ended[:, None], 3))
    assert len(np.unique(after["number"][ended])) == ended_count
    same = jax.jit(restart.restart_all, static_argnums=0)(reset, ended, ongoing)
    jax.tree.map(np.testing.assert_array_equal, after, same)


def fleet():
    """Keys, states of which every third ends with the next step, and actions."""
    keys = jax.random.split(jax.random.key(1), COUNT)
    _, states = jax.vmap(ENV.reset, (0, None))(keys, PARAMS)
    return keys, states.replace(time=jnp.arange(COUNT) % 3), jnp.arange(COUNT) % 19


def assert_alike(ours, expected, rows=slice(None)):
    for a, b in zip(jax.tree.leaves(ours), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(a[rows], b[rows], rtol=1e-5, atol=1e-6)


def one_by_one(keys, states, actions):
    """Steps of single spacecraft, which no vmap has seen."""
    step = jax.jit(ENV.step)
    rows = [jax.tree.map(lambda x, i=i: x[i], (keys, states, actions)) for i in range(COUNT)]
    return jax.tree.map(lambda *x: jnp.stack(x), *(step(*row, PARAMS) for row in rows))


def test_a_mapped_step_is_that_of_each():
    """New episodes included: each is drawn with its own key, whoever draws it."""
    fleet_now = fleet()
    expected = one_by_one(*fleet_now)
    assert expected[4].sum() == COUNT // 3
    assert_alike(jax.jit(jax.vmap(ENV.step, AXES))(*fleet_now, PARAMS), expected)
    squares = jax.tree.map(lambda x: x.reshape(4, 8, *x.shape[1:]), fleet_now)
    twice = jax.jit(jax.vmap(jax.vmap(ENV.step, AXES), AXES))(*squares, PARAMS)
    assert_alike(jax.tree.map(lambda x: x.reshape(COUNT, *x.shape[2:]), twice), expected)


def test_what_is_the_same_for_all_need_not_be_mapped():
    keys, states, _ = fleet()
    same_key = jax.vmap(ENV.step, (None, 0, None, None))(keys[5], states, 1, PARAMS)
    expected = one_by_one(jnp.broadcast_to(keys[5], COUNT), states, jnp.ones(COUNT, int))
    assert_alike(same_key, expected)
    ended = np.asarray(same_key[4])
    assert len(np.unique(np.asarray(same_key[1].quaternion)[ended], axis=0)) == 1


def test_each_may_have_parameters_of_its_own():
    keys, states, actions = fleet()
    limits = jnp.linspace(0.1, 0.9, COUNT)
    params = PARAMS.replace(min_slew_angle=limits, max_slew_angle=limits)
    axes = jax.tree.map(lambda x: None, PARAMS).replace(min_slew_angle=0, max_slew_angle=0)
    _, after, *_ = jax.vmap(ENV.step, (0, 0, 0, axes))(keys, states, actions, params)
    angles = 2 * np.arccos(np.asarray(after.quaternion)[:, 3])
    np.testing.assert_allclose(angles[2::3], limits[2::3], atol=1e-3)


def test_a_mapped_step_draws_only_for_those_that_ended():
    """On CPU a loop, of portions; one draw for each spacecraft is what it is there to spare."""
    step = jax.jit(jax.vmap(ENV.step, AXES))
    text = step.trace(*fleet(), PARAMS).lower(lowering_platforms=("cpu",)).as_text()
    assert "top_k" in text
    text = step.trace(*fleet(), PARAMS).lower(lowering_platforms=("cuda",)).as_text()
    assert "top_k" not in text


def test_a_start_may_hang_on_what_is_differentiated():
    """A closure of the environment's, over a number that ``grad`` follows."""

    def total(rate):
        def moving(key, params):
            state = initial_state.initial_state(key, params)
            return state.replace(angular_velocity=jnp.full(3, rate))

        env = AttitudeEnv(frameskip=5, initial_state=moving)
        keys, states, actions = fleet()
        _, after, *_ = jax.vmap(env.step, AXES)(keys, states, actions, PARAMS)
        return jnp.sum(after.angular_velocity[2::3])

    assert jax.grad(total)(0.1) == pytest.approx(3 * (COUNT // 3))


@pytest.mark.parametrize("gradient", [jax.grad, jax.jacfwd])
def test_a_mapped_step_has_gradients(gradient):
    keys, states, actions = fleet()

    def total(quaternion, mapped):
        def reward(key, quaternion, state, action):
            return ENV.step(key, state.replace(quaternion=quaternion), action, PARAMS)[2]

        if not mapped:
            return reward(keys[1], quaternion[1], jax.tree.map(lambda x: x[1], states), actions[1])
        return jnp.sum(jax.vmap(reward)(keys, quaternion, states, actions))

    ours = gradient(total)(states.quaternion, True)
    np.testing.assert_allclose(ours[1], gradient(total)(states.quaternion, False)[1], rtol=1e-4)
    assert np.all(np.isfinite(ours)) and np.any(ours[1] != 0)
