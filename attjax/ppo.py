"""PPO: rollout, advantages and clipped updates, fused in one jitted block.

Works with any environment of ``AttitudeEnv``'s protocol.
"""

import functools
import math
from typing import Any

import chex
import jax
import jax.flatten_util
import jax.numpy as jnp
import optax
from flax import struct

from attjax import losses, vector
from attjax.learner import (
    LEARNER_SPECS,
    SHARED,
    Learner,
    Setup,
    entropy_coefficient,
    on_devices,
    optimizer,
)
from attjax.networks import Inputs
from attjax.rollout import Step, encode, episode_sums, pick, rollout

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


@functools.partial(
    jax.jit,
    static_argnames="setup",
    donate_argnames="learner",
    compiler_options=vector.COMPILER_OPTIONS,
)
def train_block(setup: Setup, env_params, learner: Learner, num_updates):
    """Run ``num_updates`` updates (traced, so that every block shares one compilation).

    Returns:
        The learner and metrics: "losses", means over the block's updates; "episodes", sums
        over the episodes that ended, one a group; "diverged", for each checked
        quantity the first update in which it was not finite, −1 if none.
    """
    block = functools.partial(_block_on_device, setup)
    specs = (SHARED, LEARNER_SPECS, SHARED)
    return on_devices(setup, block, specs, (LEARNER_SPECS, SHARED))(
        env_params, learner, num_updates
    )


def _block_on_device(setup, env_params, learner, num_updates):
    def body(_, carry):
        learner, totals, diverged = carry
        index = learner.update
        learner, metrics, finite = update(setup, env_params, learner)
        diverged = {
            name: jnp.where((diverged[name] < 0) & ~ok, index, diverged[name])
            for name, ok in finite.items()
        }
        return learner, jax.tree.map(jnp.add, totals, metrics), diverged

    _, metrics, finite = jax.eval_shape(functools.partial(update, setup), env_params, learner)
    totals = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), metrics)
    diverged = {name: jnp.full((), -1, learner.update.dtype) for name in finite}
    learner, totals, diverged = jax.lax.fori_loop(0, num_updates, body, (learner, totals, diverged))
    means = jax.tree.map(lambda x: x / num_updates, totals["losses"])
    return learner, {"losses": means, "episodes": totals["episodes"], "diverged": diverged}


@functools.partial(jax.jit, static_argnames="setup")
def update(setup: Setup, env_params, learner: Learner):
    """One update on one device: rollout, advantages, N passes of minibatch gradient steps.

    Jitted so that it is traced once, for the shapes of its metrics and for the block's loop.

    Returns:
        The learner, its metrics and {name: bool} whether each checked quantity is finite, all
        of them the same on every device but for the learner's spacecraft.
    """
    learner, steps = rollout(setup, env_params, learner)
    samples = with_advantages(setup, env_params, learner, steps)
    learner, losses_ = optimize(setup, learner, samples)
    not_finite = {
        "observations": _any_not_finite(steps.inputs.features),
        "rewards": _any_not_finite(steps.reward),
        "losses": _any_not_finite(losses_),
        "parameters": _any_not_finite(learner.params),
    }
    finite = jax.tree.map(lambda x: ~jax.lax.pmax(x, vector.AXIS), not_finite)
    metrics = {
        "losses": jax.lax.pmean(losses_, vector.AXIS),
        "episodes": jax.lax.psum(episode_sums(setup, steps), vector.AXIS),
    }
    return learner.replace(update=learner.update + 1), metrics, finite


def with_advantages(setup, env_params, learner, steps: Step) -> Sample:
    """Values after the rollout, its advantages and the value targets.

    The values are computed step by step, as a step of all spacecraft fits the cache.
    """
    settings = setup.settings

    def value(features):
        return setup.policy.value(learner.params, features)

    def value_of(observation):
        return value(encode(setup, env_params, observation).features)

    values = jax.lax.map(value, steps.inputs.features)
    if settings.time_limit_terminates:
        terminated = steps.terminated | steps.truncated
        next_values = jnp.concatenate([values[1:], value_of(learner.observation)[None]])
    else:
        terminated = steps.terminated
        next_values = jax.lax.map(value_of, steps.final_observation)
    advantages = losses.generalized_advantages(
        steps.reward,
        values,
        next_values,
        terminated,
        steps.terminated | steps.truncated,
        discounts(setup, env_params),
        settings.gae_lambda,
    )
    samples = Sample(
        inputs=steps.inputs,
        action=steps.action,
        log_probability=steps.log_probability,
        advantage=advantages,
        target=advantages + values,
    )
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), samples)


def discounts(setup, env_params) -> chex.Array:
    """(envs_per_device,) discount of an agent step, or a scalar where it is the same for all."""
    settings = setup.settings
    if settings.discount_period == 0:
        return jnp.array(settings.discount, float)

    def discount(env_params):
        period = setup.env.context(env_params).control_period
        return settings.discount ** (period / settings.discount_period)

    axes = setup.param_axes(env_params)
    return jax.vmap(discount, (axes,), axis_size=setup.envs_per_device)(env_params)


def optimize(setup, learner, samples: Sample) -> tuple[Learner, dict]:
    """N passes of shuffled minibatches. Returns the learner and the losses' means.

    Each device shuffles its own samples; a minibatch takes the same number of each device's.
    What is shuffled are blocks of neighbours, up to SHUFFLED_TOGETHER spacecraft at one time:
    samples independent of each other that memory gives four times as fast as single ones.
    """
    settings = setup.settings
    transformation = optimizer(settings)
    per_device = settings.minibatch_size // setup.num_devices
    block = math.gcd(setup.envs_per_device, per_device, SHUFFLED_TOGETHER)
    num_blocks = len(samples.action) // block
    entropy_weight = entropy_coefficient(settings, learner.update)

    def gradient_step(carry, minibatch):
        params, state = carry
        chosen, advantage = minibatch
        sample = jax.tree.map(lambda x: take_blocks(x, num_blocks, chosen), samples)
        sample = sample.replace(advantage=advantage)
        gradients, metrics = jax.grad(loss, argnums=1, has_aux=True)(
            setup, params, sample, entropy_weight
        )
        gradients = _mean_over_devices(gradients)
        new = {n: transformation.update(gradients[n], state[n], params[n]) for n in params}
        params = {n: optax.apply_updates(params[n], new[n][0]) for n in params}
        return (params, {n: new[n][1] for n in params}), metrics

    def one_pass(carry, key):
        used = settings.minibatches * (per_device // block)
        order = random_order(key, num_blocks)[:used].reshape(settings.minibatches, -1)
        advantage = take_blocks(samples.advantage, num_blocks, order)
        advantage = advantage.reshape(settings.minibatches, -1)
        if settings.normalize_advantage:
            advantage = losses.standardize(advantage, _minibatch_means)
        return jax.lax.scan(gradient_step, carry, (order, advantage))

    key, pass_key = jax.random.split(learner.key)
    pass_key = jax.random.fold_in(pass_key, jax.lax.axis_index(vector.AXIS))
    (params, state), metrics = jax.lax.scan(
        one_pass,
        (learner.params, learner.optimizer),
        jax.random.split(pass_key, settings.passes),
    )
    learner = learner.replace(params=params, optimizer=state, key=key)
    return learner, jax.tree.map(jnp.mean, metrics)


def take_blocks(x, num_blocks, chosen):
    """Some of the equal blocks that the first axis of x is made of, one after another."""
    flat = jnp.take(x.reshape(num_blocks, -1), chosen, axis=0, mode="clip")
    return flat.reshape(-1, *x.shape[1:])


def random_order(key, count: int) -> chex.Array:
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
    return jax.lax.pmean(jnp.mean(x, axis=1, keepdims=True), vector.AXIS)


def _mean_over_devices(tree):
    """Mean over the devices, in a single exchange."""
    flat, restore = jax.flatten_util.ravel_pytree(tree)
    return restore(jax.lax.pmean(flat, vector.AXIS))


def loss(
    setup: Setup, params: dict, sample: Sample, entropy_weight
) -> tuple[chex.Array, dict[str, Any]]:
    """Clipped objective with entropy bonus plus the value's mean squared error.

    The two networks share no parameters, so the sum trains each on its own loss.
    """
    policy = setup.policy
    log_probabilities = policy.log_probabilities(params, sample.inputs)
    policy_loss, diagnostics = losses.clipped_policy_loss(
        pick(log_probabilities, sample.action),
        sample.log_probability,
        sample.advantage,
        setup.settings.clip,
    )
    entropy = jnp.mean(losses.entropy(log_probabilities))
    residual = policy.value(params, sample.inputs.features) - sample.target
    value_loss = jnp.mean(residual**2)
    metrics = {
        "policy_loss": policy_loss,
        "value_loss": value_loss,
        "entropy": entropy,
        "explained_variance": 1 - jnp.var(residual) / (jnp.var(sample.target) + 1e-12),
        **diagnostics,
    }
    return policy_loss - entropy_weight * entropy + value_loss, metrics


def _any_not_finite(tree):
    return ~jnp.all(jnp.stack([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(tree)]))
