"""Slews fly in blocks, shared out over devices, which must not show in what comes of them."""

import chex
import jax
import jax.numpy as jnp
import pytest

from attjax import AttitudeEnv, evaluation
from attjax.control.classical import phase_plane
from attjax.evaluation import episodes


def test_slews_are_the_same_in_whatever_blocks_they_fly(monkeypatch):
    """On however many devices; the last block is filled up, and the filling left out."""
    env = AttitudeEnv(frameskip=20)
    params = env.default_params.replace(max_steps_in_episode=jnp.array(40, jnp.int32))
    arguments = jax.tree_util.Partial(phase_plane), env, params, jax.random.key(3), 23
    at_once = evaluation.fly(*arguments)
    monkeypatch.setattr(episodes, "SLEWS_TOGETHER", 3)
    monkeypatch.setattr(episodes, "SLEWS_A_CALL", 12)
    so_many = []
    in_blocks = evaluation.fly(*arguments, progress=so_many.append)
    assert so_many == [12, 23]
    assert all(x.shape == (23,) for x in jax.tree.leaves(in_blocks))
    chex.assert_trees_all_close(in_blocks, at_once, rtol=1e-5, atol=1e-6)


def test_what_is_not_finite_is_no_result():
    def broken(observation, context):
        return jnp.where(observation[:3] > 2, 0.0, jnp.nan)

    env = AttitudeEnv(frameskip=20, actions="continuous")
    params = env.default_params.replace(max_steps_in_episode=jnp.array(5, jnp.int32))
    with pytest.raises(ValueError, match="is not finite in 3 of 3 slews"):
        evaluation.fly(jax.tree_util.Partial(broken), env, params, jax.random.key(0), 3)
