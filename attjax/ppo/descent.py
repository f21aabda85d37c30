"""The gradient steps of an update: shuffled minibatches, the clipped loss, Adam."""

import math
from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
import optax
from flax import struct
from jax.flatten_util import ravel_pytree

from attjax.config.settings import PPO
from attjax.ppo import losses
from attjax.ppo.networks import Inputs, Policy
from attjax.ppo.train_state import Learner, entropy_coefficient, optimizer
from attjax.sharding import AXIS

MAX_INDEX_BITS = 18

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


def optimize(
    policy: Policy, settings: PPO, learner: Learner, samples: Sample, num_devices: int
) -> tuple[Learner, dict]:
    """N passes of shuffled minibatches. Returns the learner and the losses' means.

    Each device shuffles its own samples; a minibatch takes the same number of each device's.
    What is shuffled are blocks of neighbours, up to SHUFFLED_TOGETHER spacecraft at one time:
    samples independent of each other that memory gives four times as fast as single ones.
    """
    adam = optimizer(settings)
    per_device = settings.minibatch_size // num_devices
    block = math.gcd(settings.num_envs // num_devices, per_device, SHUFFLED_TOGETHER)
    num_blocks = len(samples.action) // block
    weights = LossWeights(settings.clip, entropy_coefficient(settings, learner.update))

    def gradient_step(carry, minibatch):
        params, state = carry
        chosen, advantage = minibatch
        sample = jax.tree.map(lambda x: take_blocks(x, num_blocks, chosen), samples)
        sample = sample.replace(advantage=advantage)

        def transposed_loss(params):
            return loss(policy, _transposed(params), sample, weights)

        gradients, metrics = jax.grad(transposed_loss, has_aux=True)(params)
        return _descend(adam, params, state, gradients), metrics

    def one_pass(carry, key):
        used = settings.minibatches * (per_device // block)
        order = random_order(key, num_blocks)[:used].reshape(settings.minibatches, -1)
        advantage = take_blocks(samples.advantage, num_blocks, order)
        advantage = advantage.reshape(settings.minibatches, -1)
        if settings.normalize_advantage:
            advantage = losses.standardize(advantage, _minibatch_means)
        return jax.lax.scan(gradient_step, carry, (order, advantage))

    key, pass_key = jax.random.split(learner.key)
    pass_key = jax.random.fold_in(pass_key, jax.lax.axis_index(AXIS))
    pass_keys = jax.random.split(pass_key, settings.passes)
    start = _transposed((learner.params, learner.optimizer))
    end, metrics = jax.lax.scan(one_pass, start, pass_keys)
    params, state = _transposed(end)
    learner = learner.replace(params=params, optimizer=state, key=key)
    return learner, jax.tree.map(jnp.mean, metrics)


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


def _minibatch_means(x):
    """Means over each row of x, a minibatch, and over the devices that share it."""
    return jax.lax.pmean(jnp.mean(x, axis=1, keepdims=True), AXIS)


def _transposed(tree):
    """The same with all matrices transposed.

    Kernels lie so in the loop, as the products take and give them: transposing those of 400-300
    and their gradients in every step costs a fourteenth of an update of ``paper``.
    """
    return jax.tree.map(jnp.transpose, tree)


def _descend(transformation, params, state, gradients):
    """The optimizer's step along the gradients' mean over the devices.

    Nothing joins the two networks on one device: XLA steps them side by side on two cores.
    """
    if jax.lax.axis_size(AXIS) > 1:
        joined, part = ravel_pytree(gradients)  # a single exchange
        gradients = part(jax.lax.pmean(joined, AXIS))
    moved, states = {}, {}
    for name, network in params.items():
        move, states[name] = transformation.update(gradients[name], state[name])
        moved[name] = optax.apply_updates(network, move)
    return moved, states


class LossWeights(NamedTuple):
    """What weighs in :func:`loss`: ε of Eq. 4, and the entropy bonus's c."""

    clip: float
    entropy: chex.Array | float


def loss(
    policy: Policy, params: dict, sample: Sample, weights: LossWeights
) -> tuple[chex.Array, dict[str, Any]]:
    """Clipped objective with entropy bonus plus the value's mean squared error.

    The two networks share no parameters, so the sum trains each on its own loss.
    """
    distribution = policy.distribution(params, sample.inputs)
    policy_loss, diagnostics = losses.clipped_policy_loss(
        distribution.log_probability(sample.action),
        sample.log_probability,
        sample.advantage,
        weights.clip,
    )
    entropy = jnp.mean(distribution.entropy())
    residual = policy.value(params, sample.inputs.features) - sample.target
    value_loss = jnp.mean(residual**2)
    metrics = {
        "policy_loss": policy_loss,
        "value_loss": value_loss,
        "entropy": entropy,
        "explained_variance": 1 - jnp.var(residual) / (jnp.var(sample.target) + 1e-12),
        **diagnostics,
    }
    return policy_loss - weights.entropy * entropy + value_loss, metrics
