"""Noise of an agent step: its hash against JAX's, its numbers against the normal distribution."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.random import threefry_2x32
from scipy import stats

from attjax.dynamics.noise import Noise, threefry

KEY = jax.random.key_data(jax.random.key(3))


def drawn(name, count, steps=400_000, dtype=jnp.float32):
    """(steps, count) numbers of one spacecraft's agent steps."""
    of = jax.vmap(lambda time: jnp.stack(Noise.of(KEY, time).normal(name, count, dtype)))
    return np.asarray(jax.jit(of)(jnp.arange(steps)), float)


def test_the_hash_is_jaxs():
    words = jax.random.bits(jax.random.key(0), (2, 100))
    ours = jnp.concatenate(threefry((KEY[0], KEY[1]), (words[0], words[1])))
    np.testing.assert_array_equal(ours, threefry_2x32(KEY, words.ravel()))


@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_numbers_are_standard_normal_and_independent(dtype):
    """Moments and tails; pairs of one hash, of several, and of neighbouring steps."""
    with jax.enable_x64(dtype == jnp.float64):
        x = np.concatenate([drawn("a", 3, dtype=dtype), drawn("b", 2, dtype=dtype)], axis=1)
    count = len(x)
    assert np.all(np.isfinite(x))
    for power, mean, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)):
        off = np.abs(np.mean(x**power, axis=0) - mean)
        assert np.all(off < 4 * np.sqrt(variance / count)), power
    for size in (1, 2, 3, 4, 4.5):
        expected = count * x.shape[1] * 2 * stats.norm.sf(size)
        assert abs(np.sum(np.abs(x) > size) - expected) < 4 * np.sqrt(expected)
    assert all(stats.kstest(column, "norm").pvalue > 1e-3 for column in x.T)
    later = np.concatenate([x[:-1], x[1:]], axis=1)
    for values in (later, later**2):
        others = np.corrcoef(values.T) - np.eye(10)
        assert np.abs(others).max() < 5 / np.sqrt(count)


def test_a_number_has_its_name_step_and_key():
    few, more = drawn("a", 3, 100), drawn("a", 6, 100)
    np.testing.assert_array_equal(few, more[:, :3])
    assert not np.any(few == drawn("b", 3, 100)) and len(np.unique(more)) == more.size
    other = jax.random.key_data(jax.random.key(4))
    assert Noise.of(other, 0).normal("a", 1, jnp.float32)[0] != few[0, 0]
