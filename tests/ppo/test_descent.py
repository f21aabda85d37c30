"""The gradient steps of an update, against NumPy and the formulas written out anew."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree
from jax.sharding import PartitionSpec
from setups import small_attitude_setup

from attjax import sharding
from attjax.ppo import descent, train_state
from attjax.ppo.networks import Inputs

ACTIONS = 19
WEIGHTS = descent.LossWeights(clip=0.2, entropy=0.0)


def small_setup(num_devices=1, **overrides):
    """8 spacecraft that make 128 samples."""
    sizes = {"num_envs": 8, "rollout_length": 16, "minibatch_size": 32, "hidden_sizes": (4,)}
    overrides = sizes | {"frameskips": (20,), "features": "state", "rate_margin": 0.0} | overrides
    setup = small_attitude_setup(3, **overrides)
    return dataclasses.replace(setup, num_devices=num_devices)


def split_setup(**overrides):
    """The same, a device for each network."""
    return dataclasses.replace(small_setup(2, **overrides), splits_networks=True)


def random_samples(count):
    rng = np.random.default_rng(0)
    return descent.Sample(
        inputs=Inputs(jnp.array(rng.normal(size=(count, 11)), float), jnp.ones((count, 19), bool)),
        action=jnp.array(rng.integers(0, ACTIONS, count)),
        log_probability=jnp.array(rng.normal(-3, 0.3, count), float),
        advantage=jnp.array(rng.normal(0.7, 2, count), float),
        target=jnp.array(rng.normal(1, 1, count), float),
    )


def new_learner(setup, update=0):
    """With random parameters; no gradient step looks at its spacecraft."""
    rng = np.random.default_rng(1)

    def network(outputs):
        shapes = {"Dense_0": (11, 4), "Dense_1": (4, outputs)}
        return {
            "params": {
                name: {
                    "kernel": jnp.array(rng.normal(0, 0.3, shape), float),
                    "bias": jnp.array(rng.normal(0, 0.3, shape[1]), float),
                }
                for name, shape in shapes.items()
            }
        }

    params = {"policy": network(ACTIONS), "value": network(1)}
    adam = train_state.optimizer(setup.settings.ppo)
    none = jnp.zeros(setup.settings.ppo.num_envs)
    return train_state.Learner(
        params=params,
        optimizer={name: adam.init(ravel_pytree(x)[0]) for name, x in params.items()},
        states=none,
        observation=none,
        score=none,
        is_whole=none,
        key=jax.random.key(0),
        update=jnp.int32(update),
    )


def optimized(setup, samples, update=0):
    """The learner before, the one after and the metrics."""
    before = new_learner(setup, update)
    specs = (train_state.LEARNER_SPECS, sharding.SPLIT)
    run = sharding.on_devices(
        setup.num_devices,
        functools.partial(descent.optimize, setup),
        specs,
        (train_state.LEARNER_SPECS, PartitionSpec()),
    )
    return before, *jax.jit(run)(before, samples)


def written_out_loss(params, samples, advantage, clip, entropy_weight):
    """Eq. 4, the entropy bonus and the mean squared error, sample by sample, and its metrics."""

    def network(params, x):
        layers = params["params"]
        x = jnp.maximum(x @ layers["Dense_0"]["kernel"] + layers["Dense_0"]["bias"], 0)
        return x @ layers["Dense_1"]["kernel"] + layers["Dense_1"]["bias"]

    logits = network(params["policy"], samples.inputs.features)
    probabilities = jnp.exp(logits) / jnp.sum(jnp.exp(logits), axis=1, keepdims=True)
    taken = probabilities[jnp.arange(len(samples.action)), samples.action]
    ratio = taken / jnp.exp(samples.log_probability)
    bounded = jnp.minimum(jnp.maximum(ratio, 1 - clip), 1 + clip)
    gain = jnp.mean(jnp.minimum(ratio * advantage, bounded * advantage))
    entropy = -jnp.mean(jnp.sum(probabilities * jnp.log(probabilities), axis=1))
    miss = network(params["value"], samples.inputs.features)[:, 0] - samples.target
    metrics = {
        "policy_loss": -gain,
        "value_loss": jnp.mean(miss**2),
        "entropy": entropy,
        "explained_variance": 1 - jnp.var(miss) / jnp.var(samples.target),
    }
    return -gain - entropy_weight * entropy + jnp.mean(miss**2), metrics


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


def test_a_device_for_each_network_gives_it_all_samples(monkeypatch):
    """Whole minibatches of its own order, of the spacecraft of both."""
    setup = split_setup(num_envs=16, rollout_length=64, minibatch_size=64, passes=3)
    taken, _ = minibatches(monkeypatch, setup, 1024)
    for device in (0, 1):
        numbers = [x for of, x, _ in taken if of == device]
        assert len(numbers) == 3 * 16 and {len(x) for x in numbers} == {64}
        np.testing.assert_array_equal(np.bincount(np.concatenate(numbers)), np.full(1024, 3))
        assert sum(len(set(x // 512)) == 2 for x in numbers) > 40
    orders = [np.concatenate([x for of, x, _ in taken if of == device]) for device in (0, 1)]
    assert np.mean(orders[0] == orders[1]) < 0.1


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


@pytest.mark.parametrize("make_setup", [small_setup, split_setup])
@pytest.mark.parametrize("normalize, max_norm", [(True, 0.05), (False, 0.0)])
def test_a_gradient_step_is_adams_along_the_loss_written_out(x64, make_setup, normalize, max_norm):
    """All samples in one minibatch; Adam's first moment is a tenth of the gradient, clipped."""
    setup = make_setup(
        minibatch_size=128,
        passes=1,
        normalize_advantage=normalize,
        max_gradient_norm=max_norm,
        entropy_coefficient=0.4,
        final_entropy_coefficient=0.1,
    )
    samples = random_samples(128)
    before, after, metrics = optimized(setup, samples, update=1)
    advantage = np.asarray(samples.advantage)
    if normalize:
        advantage = (advantage - advantage.mean()) / advantage.std()
    gradients, expected = jax.grad(written_out_loss, has_aux=True)(
        before.params, samples, advantage, setup.settings.ppo.clip, 0.3
    )
    for name, gradient in gradients.items():
        gradient, _ = ravel_pytree(gradient)
        norm = float(jnp.linalg.norm(gradient))
        assert norm > 0.05
        if max_norm:
            gradient = gradient * max_norm / norm
        adam = after.optimizer[name][1][0]
        np.testing.assert_allclose(adam.mu, 0.1 * gradient, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(adam.nu, 0.001 * gradient**2, rtol=1e-6, atol=1e-15)
        moved = [ravel_pytree(x.params[name])[0] for x in (before, after)]
        step = setup.settings.ppo.learning_rate * gradient / (abs(gradient) + 1e-8)
        np.testing.assert_allclose(moved[0] - moved[1], step, rtol=1e-6, atol=1e-12)
    for name, value in expected.items():
        assert float(metrics[name]) == pytest.approx(float(value), rel=1e-6), name


def test_explained_variance_of_a_constant_target():
    """1 − Var(residual)/(0 + 1e-12), finite: a value that is constant too explains all."""
    setup = small_setup()
    params = new_learner(setup).params
    samples = random_samples(4)
    inputs = samples.inputs.replace(features=jnp.ones((4, 11)))
    constant = samples.replace(target=jnp.ones(4), inputs=inputs)
    _, metrics = descent.loss(setup.policy, params, constant, WEIGHTS)
    assert float(metrics["explained_variance"]) == pytest.approx(1, abs=1e-2)
    _, metrics = descent.loss(setup.policy, params, samples.replace(target=jnp.ones(4)), WEIGHTS)
    assert -np.inf < float(metrics["explained_variance"]) < -1e6  # a value that is not
