"""The gradient steps of an update: shuffled minibatches, the clipped loss, Adam."""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
import optax
from flax import struct
from jax.flatten_util import ravel_pytree

from attjax.ppo import losses
from attjax.ppo.networks import Inputs, Policy
from attjax.ppo.train_state import Learner, Setup, entropy_coefficient, optimizer
from attjax.sharding import AXIS

MAX_INDEX_BITS = 18

NETWORKS = ("policy", "value")
METRICS = (
    "policy_loss", "value_loss", "entropy", "explained_variance", "approximate_kl", "clip_fraction",
)  # fmt: skip

SHUFFLED_TOGETHER = 8
"""Most neighbouring spacecraft whose samples stay together in a shuffle."""


@struct.dataclass
class Sample:
    """What the losses need of a step; fields are (samples, ...)."""

    inputs: Inputs
    action: chex.Array
    log_probability: chex.Array
    advantage: chex.Array
    target: chex.Array


def optimize(setup: Setup, learner: Learner, samples: Sample) -> tuple[Learner, dict]:
    """N passes of shuffled minibatches. Returns the learner and the losses' means.

    Each device shuffles its own samples; a minibatch takes the same number of each device's. Where
    ``setup.splits_networks``, one device trains the policy and the other the value network, each
    on all samples, without a word between them: minibatches too small to be worth sharing.
    """
    key, pass_key = jax.random.split(learner.key)
    pass_key = jax.random.fold_in(pass_key, jax.lax.axis_index(AXIS))
    pass_keys = jax.random.split(pass_key, setup.settings.ppo.passes)
    learner = learner.replace(key=key)
    if not setup.splits_networks:
        return _descend(setup, Work(NETWORKS, _mean_of_devices), learner, samples, pass_keys)
    samples = jax.tree.map(lambda x: jax.lax.all_gather(x, AXIS, tiled=True), samples)
    owner = {name: jax.lax.axis_index(AXIS) == i for i, name in enumerate(NETWORKS)}
    trained, metrics = jax.lax.cond(
        owner["policy"],
        functools.partial(_descend, setup, Work(("policy",))),
        functools.partial(_descend, setup, Work(("value",))),
        *(learner, samples, pass_keys),
    )
    params, state = (
        {name: _from_its_owner(owner[name], part[name]) for name in NETWORKS}
        for part in (trained.params, trained.optimizer)
    )
    return learner.replace(params=params, optimizer=state), jax.lax.psum(metrics, AXIS)


def _from_its_owner(is_owner, tree):
    """What the device that it is true of has there, on all devices."""
    return jax.tree.map(lambda x: jax.lax.psum(jnp.where(is_owner, x, 0), AXIS), tree)


def _mean_of_devices(tree):
    """Of all devices, in a single exchange."""
    vector, restore = ravel_pytree(tree)
    return restore(jax.lax.pmean(vector, AXIS))


class Work(NamedTuple):
    """A device's part of the gradient steps: which networks, and how devices that share a
    minibatch make one number of theirs.
    """

    networks: tuple[str, ...]
    mean: Callable = lambda tree: tree


def _descend(setup, work, learner, samples, pass_keys):
    """The passes over a device's samples for some networks, and their metrics, 0 for the others.

    What is shuffled are blocks of neighbours, up to SHUFFLED_TOGETHER spacecraft at one time:
    samples independent of each other that memory gives four times as fast as single ones.
    """
    settings, adam = setup.settings.ppo, optimizer(setup.settings.ppo)
    size = settings.minibatch_size // (1 if setup.splits_networks else setup.num_devices)
    block = math.gcd(setup.envs_per_device, size, SHUFFLED_TOGETHER)
    num_blocks = len(samples.action) // block
    weights = LossWeights(settings.clip, entropy_coefficient(settings, learner.update))

    def gradient_step(carry, minibatch):
        params, state = carry
        chosen, advantage = minibatch
        sample = jax.tree.map(lambda x: take_blocks(x, num_blocks, chosen), samples)
        sample = sample.replace(advantage=advantage)
        gradients, metrics = jax.grad(loss, argnums=1, has_aux=True)(
            setup.policy, params, sample, weights
        )
        return _gradient_step(adam, params, state, work.mean(gradients)), metrics

    def one_pass(carry, key):
        used = settings.minibatches * (size // block)
        order = random_order(key, num_blocks)[:used].reshape(settings.minibatches, -1)
        advantage = take_blocks(samples.advantage, num_blocks, order)
        advantage = advantage.reshape(settings.minibatches, -1)
        if settings.normalize_advantage:
            advantage = losses.standardize(advantage, lambda x: work.mean(_row_means(x)))
        return jax.lax.scan(gradient_step, carry, (order, advantage))

    start = [{x: tree[x] for x in work.networks} for tree in (learner.params, learner.optimizer)]
    (params, state), metrics = jax.lax.scan(one_pass, tuple(start), pass_keys)
    metrics = {name: jnp.mean(metrics[name]) if name in metrics else 0.0 for name in METRICS}
    params, state = learner.params | params, learner.optimizer | state
    return learner.replace(params=params, optimizer=state), metrics


def take_blocks(x: chex.Array, num_blocks: int, chosen: chex.Array) -> chex.Array:
    """Some of the equal blocks that the first axis of x is made of, one after another."""
    flat = jnp.take(x.reshape(num_blocks, -1), chosen, axis=0, mode="clip")
    return flat.reshape(-1, *x.shape[1:])


def random_order(key: chex.PRNGKey, count: int) -> chex.Array:
    """(count,) a random permutation of range(count).

    Sorts words that end in the index and begin with random bits: eight times as fast on CPU as
    ``jax.random.permutation``. The few neighbours with equal random bits keep their order; where
    the index leaves too few random bits, it is ``jax.random.permutation`` after all.
    """
    index_bits = max(count - 1, 1).bit_length()
    if index_bits > MAX_INDEX_BITS:
        return jax.random.permutation(key, count)
    index_mask = jnp.uint32((1 << index_bits) - 1)
    words = jax.random.bits(key, (count,), jnp.uint32)
    words = (words & ~index_mask) | jnp.arange(count, dtype=jnp.uint32)
    return jnp.sort(words) & index_mask


def _row_means(x):
    """Means over each row of x, a minibatch."""
    return jnp.mean(x, axis=1, keepdims=True)


def _gradient_step(transformation, params, state, gradients):
    """The optimizer's step, for each network along its gradient as one vector."""
    moved, states = {}, {}
    for name, tree in params.items():
        vector, _ = ravel_pytree(gradients[name])
        move, states[name] = transformation.update(vector, state[name])
        _, restore = ravel_pytree(tree)
        moved[name] = optax.apply_updates(tree, restore(move))
    return moved, states


class LossWeights(NamedTuple):
    """What weighs in :func:`loss`: ε of Eq. 4, and the entropy bonus's c."""

    clip: float
    entropy: chex.Array | float


def loss(
    policy: Policy, params: dict, sample: Sample, weights: LossWeights
) -> tuple[chex.Array, dict[str, Any]]:
    """The sum of the losses of those networks that there are parameters of, and METRICS of them.

    The two networks share no parameters, so the sum trains each on its own loss.
    """
    total, metrics = jnp.zeros(()), dict[str, Any]()
    for name, loss_of in (("policy", policy_loss), ("value", value_loss)):
        if name in params:
            of_network, more = loss_of(policy, params, sample, weights)
            total, metrics = total + of_network, metrics | more
    return total, metrics


def policy_loss(
    policy: Policy, params: dict, sample: Sample, weights: LossWeights
) -> tuple[chex.Array, dict[str, Any]]:
    """Clipped objective (Eq. 4) with entropy bonus, and its metrics."""
    log_probabilities = policy.log_probabilities(params, sample.inputs)
    clipped, diagnostics = losses.clipped_policy_loss(
        losses.pick(log_probabilities, sample.action),
        sample.log_probability,
        sample.advantage,
        weights.clip,
    )
    entropy = jnp.mean(losses.entropy(log_probabilities))
    metrics = {"policy_loss": clipped, "entropy": entropy, **diagnostics}
    return clipped - weights.entropy * entropy, metrics


def value_loss(
    policy: Policy, params: dict, sample: Sample, weights: LossWeights
) -> tuple[chex.Array, dict[str, Any]]:
    """Mean squared error of V(s), and its metrics."""
    del weights
    residual = policy.value(params, sample.inputs.features) - sample.target
    squared = jnp.mean(residual**2)
    explained = 1 - jnp.var(residual) / (jnp.var(sample.target) + 1e-12)
    return squared, {"value_loss": squared, "explained_variance": explained}
