"""Random orders and blocks of samples, of which an update's minibatches are made."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax.ppo import descent, losses


def test_large_orders_leave_few_random_bits_to_none(monkeypatch):
    """Up to 2^18 samples are sorted by words; beyond, JAX permutes."""
    called = []
    monkeypatch.setattr(jax.random, "permutation", lambda key, n: called.append(n) or jnp.arange(n))
    for count in (2**18, 2**18 + 1):
        descent.random_order(jax.random.key(0), count)
    assert called == [2**18 + 1]


def test_standardized_rows_are_each_their_own():
    """The means that the minibatches of a pass are standardized by."""
    rows = jnp.array([[1.0, 3.0], [10.0, 30.0]])
    mean = jax.vmap(descent._minibatch_means, axis_name=descent.AXIS)(rows[None])[0]
    np.testing.assert_allclose(mean, [[2.0], [20.0]])
    assert losses.standardize(rows[0]).tolist() == pytest.approx([-1, 1])


@pytest.mark.parametrize("count", [1, 2, 1000, 4096, 300_000])
def test_random_order_is_a_permutation_that_mixes(count):
    order = np.asarray(jax.jit(descent.random_order, static_argnums=1)(jax.random.key(0), count))
    np.testing.assert_array_equal(np.sort(order), np.arange(count))
    if count >= 1000:
        # The rank correlation of a random order has standard deviation 1/sqrt(count − 1).
        correlation = np.corrcoef(order, np.arange(count))[0, 1]
        assert abs(correlation) < 5 / np.sqrt(count - 1)
        assert not np.array_equal(order, descent.random_order(jax.random.key(1), count))


def test_a_pass_takes_every_sample_once_and_whole():
    """Fields stay together, neighbours in a block too, whatever their shapes."""
    numbers = jnp.arange(48)
    samples = {"plain": numbers, "wide": jnp.stack([numbers, -numbers], axis=1)}
    order = jnp.array([[3, 0, 5], [1, 4, 2]])
    taken = [jax.tree.map(lambda x, o=o: descent.take_blocks(x, 6, o), samples) for o in order]
    assert taken[0]["plain"].tolist() == [*range(24, 32), *range(8), *range(40, 48)]
    np.testing.assert_array_equal(taken[1]["wide"][:, 1], -taken[1]["plain"])
    both = np.concatenate([part["plain"] for part in taken])
    np.testing.assert_array_equal(np.sort(both), numbers)
