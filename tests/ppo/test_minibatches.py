"""What the minibatches of an update hold, pass by pass and device by device."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from descents import optimized, random_samples, small_setup

from attjax import sharding
from attjax.ppo import descent


class Minibatches:
    """Stands in for the loss and keeps what it was given."""

    def __init__(self):
        self.taken = []

    def loss(self, policy, params, sample, weights):
        device = jax.lax.axis_index(sharding.AXIS)
        jax.debug.callback(self._keep, device, sample.action, sample.advantage, sample.target)
        nothing = sum(jnp.sum(0 * x) for x in jax.tree.leaves(params))
        return nothing, {"value_loss": jnp.mean(sample.target)}

    def _keep(self, device, *fields):
        self.taken.append((int(device), *map(np.asarray, fields)))


def numbered_samples(count):
    """Samples that are told apart by action and target; the advantage is a function of these."""
    numbers = np.arange(count)
    samples = random_samples(count)
    return samples.replace(
        action=jnp.array(numbers),
        target=jnp.array(numbers, float),
        advantage=jnp.array(np.sin(numbers), float),
    )


def minibatches(monkeypatch, setup, count):
    """(device, numbers, advantages) of each gradient step of an update, and its metrics."""
    kept = Minibatches()
    monkeypatch.setattr(descent, "loss", kept.loss)
    _, _, metrics = optimized(setup, numbered_samples(count))
    jax.effects_barrier()
    for _, action, _, target in kept.taken:
        np.testing.assert_array_equal(action, target)
    return [(device, action, advantage) for device, action, advantage, _ in kept.taken], metrics


@pytest.mark.parametrize("num_devices", [1, 2])
def test_every_pass_takes_all_samples_in_an_order_of_its_own(monkeypatch, num_devices):
    setup = small_setup(num_devices, num_envs=16, rollout_length=64, minibatch_size=64, passes=3)
    taken, metrics = minibatches(monkeypatch, setup, 1024)
    assert len(taken) == num_devices * 3 * 16
    numbers = np.concatenate([x for _, x, _ in taken])
    np.testing.assert_array_equal(np.bincount(numbers), np.full(1024, 3))
    assert float(metrics["value_loss"]) == pytest.approx(
        np.mean([x.mean() for device, x, _ in taken if device == 0]), rel=1e-6
    )
    # Were two passes, or two devices, in the same order, they would share whole minibatches.
    per_device = 1024 // num_devices
    for device, x, _ in taken:
        assert set(x // per_device) == {device} and len(x) == 64 // num_devices
    assert len({frozenset(x % per_device) for _, x, _ in taken}) == len(taken)


@pytest.mark.parametrize("num_devices", [1, 2])
def test_samples_beyond_whole_minibatches_sit_a_pass_out(monkeypatch, num_devices):
    setup = small_setup(num_devices, num_envs=8, rollout_length=16, minibatch_size=48, passes=4)
    taken, _ = minibatches(monkeypatch, setup, 128)
    assert [len(x) for _, x, _ in taken] == [48 // num_devices] * 8 * num_devices
    times = np.bincount(np.concatenate([x for _, x, _ in taken]), minlength=128)
    assert times.sum() == 4 * 96 and times.max() <= 4 and len(set(times)) > 1


@pytest.mark.parametrize("num_devices", [1, 2])
@pytest.mark.parametrize("most, steps", [(0, 4), (3, 3), (9, 4)])
def test_a_pass_has_no_more_minibatches_than_are_asked_for(monkeypatch, num_devices, most, steps):
    setup = small_setup(num_devices, passes=2, most_minibatches=most)
    taken, _ = minibatches(monkeypatch, setup, 128)
    assert len(taken) == num_devices * 2 * steps
    times = np.bincount(np.concatenate([x for _, x, _ in taken]), minlength=128)
    assert times.max() <= 2 and times.sum() == 2 * steps * 32
    assert setup.settings.ppo.minibatches == steps


@pytest.mark.parametrize("num_envs, minibatch_size, block", [(8, 32, 8), (12, 48, 4), (16, 64, 8)])
def test_neighbours_stay_together(monkeypatch, num_envs, minibatch_size, block):
    """Up to eight spacecraft, as many as divide both their number and the minibatch."""
    setup = small_setup(num_envs=num_envs, minibatch_size=minibatch_size, passes=1)
    count = num_envs * 16
    taken, _ = minibatches(monkeypatch, setup, count)
    for _, x, _ in taken:
        blocks = x.reshape(-1, block)
        np.testing.assert_array_equal(blocks[:, 0] % block, 0)
        np.testing.assert_array_equal(blocks, blocks[:, :1] + np.arange(block))
    pairs = np.concatenate([np.diff(x.reshape(-1, block)[:, 0]) for _, x, _ in taken])
    assert np.mean(pairs == block) < 0.5  # and no more of them than that


@pytest.mark.parametrize("num_devices", [1, 2])
@pytest.mark.parametrize("normalize", [True, False])
def test_advantages_are_standardized_in_each_minibatch(monkeypatch, num_devices, normalize):
    """Over all devices that share it."""
    setup = small_setup(num_devices, minibatch_size=32, passes=2, normalize_advantage=normalize)
    taken, _ = minibatches(monkeypatch, setup, 128)
    of_device = [[(x, a) for d, x, a in taken if d == device] for device in range(num_devices)]
    for parts in zip(*of_device):
        numbers, advantages = (np.concatenate(x) for x in zip(*parts))
        assert len(numbers) == 32
        expected = np.sin(numbers)
        if normalize:
            expected = (expected - expected.mean()) / expected.std()
        np.testing.assert_allclose(advantages, expected, rtol=1e-4, atol=1e-5)
