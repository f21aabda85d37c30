"""PPO: rollout, advantages and clipped updates, fused in one jitted block.

Works with any environments of ``AttitudeEnv``'s protocol; several at once make one batch.
"""

import functools
from typing import Any

import chex
import jax
import jax.numpy as jnp
import optax
from flax import struct

from attjax import losses
from attjax.learner import Learner, Setup, entropy_coefficient, optimizer
from attjax.networks import Inputs
from attjax.rollout import Step, encode, episode_sums, pick, rollout


@struct.dataclass
class Sample:
    """What the losses need of a step; fields are (samples, ...)."""

    inputs: Inputs
    action: chex.Array
    log_probability: chex.Array
    advantage: chex.Array
    target: chex.Array


@functools.partial(jax.jit, static_argnames="setup", donate_argnames="learner")
def train_block(setup: Setup, env_params: tuple, learner: Learner, num_updates):
    """Run ``num_updates`` updates (traced, so that every block shares one compilation).

    Returns:
        The learner and metrics: "losses", means over the block's updates; "episodes", sums
        over the episodes that ended, one an environment; "diverged", for each checked
        quantity the first update in which it was not finite, −1 if none.
    """
    first_update = learner.update

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
    done = learner.update - first_update
    means = jax.tree.map(lambda x: x / done, totals["losses"])
    return learner, {"losses": means, "episodes": totals["episodes"], "diverged": diverged}


def update(setup: Setup, env_params: tuple, learner: Learner):
    """One update: rollout, advantages, N passes of minibatch gradient steps.

    Returns:
        The learner, its metrics and {name: bool} whether each checked quantity is finite.
    """
    contexts = [env.context(params) for env, params in zip(setup.envs, env_params)]
    learner, steps = rollout(setup, env_params, contexts, learner)
    samples = with_advantages(setup, contexts, learner, steps)
    learner, losses_ = optimize(setup, learner, samples)
    finite = {
        "observations": _all_finite(steps.inputs.features),
        "rewards": _all_finite(steps.reward),
        "losses": _all_finite(losses_),
        "parameters": _all_finite(learner.params),
    }
    metrics = {"losses": losses_, "episodes": episode_sums(setup, steps)}
    return learner.replace(update=learner.update + 1), metrics, finite


def with_advantages(setup, contexts, learner, steps: Step) -> Sample:
    """Values of the whole rollout at once, its advantages and the value targets."""
    settings, policy = setup.settings, setup.policy
    values = policy.value(learner.params, steps.inputs.features)
    if settings.time_limit_terminates:
        terminated = steps.terminated | steps.truncated
        last = encode(setup, contexts, learner.observation).features
        last_value = policy.value(learner.params, last)
        next_values = jnp.concatenate([values[1:], last_value[None]])
    else:
        terminated = steps.terminated
        final = jax.vmap(functools.partial(encode, setup, contexts))(steps.final_observation)
        next_values = policy.value(learner.params, final.features)
    advantages = losses.generalized_advantages(
        steps.reward,
        values,
        next_values,
        terminated,
        steps.terminated | steps.truncated,
        discounts(setup, contexts),
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


def discounts(setup, contexts) -> chex.Array:
    """(num_envs,) discount of one agent step, or a scalar where it is the same for all."""
    settings = setup.settings
    if settings.discount_period == 0:
        return jnp.array(settings.discount, float)
    exponents = [c.control_period / settings.discount_period for c in contexts]
    sizes = jnp.array([group.stop - group.start for group in setup.slices])
    exponents = jnp.repeat(jnp.stack(exponents), sizes, total_repeat_length=settings.num_envs)
    return settings.discount**exponents


def optimize(setup, learner, samples: Sample) -> tuple[Learner, dict]:
    """N passes of shuffled minibatches. Returns the learner and the losses' means."""
    settings = setup.settings
    transformation = optimizer(settings)
    used = settings.minibatches * settings.minibatch_size
    entropy_weight = entropy_coefficient(settings, learner.update)

    def gradient_step(carry, sample):
        params, state = carry
        gradients, metrics = jax.grad(loss, argnums=1, has_aux=True)(
            setup, params, sample, entropy_weight
        )
        new = {n: transformation.update(gradients[n], state[n], params[n]) for n in params}
        params = {n: optax.apply_updates(params[n], new[n][0]) for n in params}
        return (params, {n: new[n][1] for n in params}), metrics

    def one_pass(carry, key):
        order = jax.random.permutation(key, settings.steps_per_update)[:used]
        shuffled = jax.tree.map(
            lambda x: x[order].reshape(settings.minibatches, -1, *x.shape[1:]), samples
        )
        return jax.lax.scan(gradient_step, carry, shuffled)

    key, pass_key = jax.random.split(learner.key)
    (params, state), metrics = jax.lax.scan(
        one_pass,
        (learner.params, learner.optimizer),
        jax.random.split(pass_key, settings.passes),
    )
    learner = learner.replace(params=params, optimizer=state, key=key)
    return learner, jax.tree.map(jnp.mean, metrics)


def loss(
    setup: Setup, params: dict, sample: Sample, entropy_weight
) -> tuple[chex.Array, dict[str, Any]]:
    """Clipped objective with entropy bonus plus the value's mean squared error.

    The two networks share no parameters, so the sum trains each on its own loss.
    """
    settings, policy = setup.settings, setup.policy
    log_probabilities = policy.log_probabilities(params, sample.inputs)
    advantage = sample.advantage
    if settings.normalize_advantage:
        advantage = losses.standardize(advantage)
    policy_loss, diagnostics = losses.clipped_policy_loss(
        pick(log_probabilities, sample.action), sample.log_probability, advantage, settings.clip
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


def _all_finite(tree):
    return jnp.all(jnp.stack([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(tree)]))
