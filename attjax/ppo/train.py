"""PPO: rollout, advantages and clipped updates, fused in one jitted block.

Works with any environment of ``AttitudeEnv``'s protocol.
"""

import functools
from typing import Any

import chex
import jax
import jax.numpy as jnp

from attjax import sharding
from attjax.config.settings import PPO
from attjax.envs import batch
from attjax.ppo import losses
from attjax.ppo.descent import Sample, optimize
from attjax.ppo.rollout import Step, encode, episode_sums, rollout
from attjax.ppo.train_state import LEARNER_SPECS, Learner, Setup
from attjax.sharding import AXIS, SHARED

CACHED = 512
"""Samples whose hidden layers of 400-300 fit the cache of a CPU core."""


@functools.partial(
    jax.jit,
    static_argnames="setup",
    donate_argnames="learner",
    compiler_options=sharding.COMPILER_OPTIONS,
)
def train_block(
    setup: Setup, env_params: chex.ArrayTree, learner: Learner, num_updates: int
) -> tuple[Learner, dict]:
    """Run ``num_updates`` updates (traced, so that every block shares one compilation).

    Returns:
        The learner and metrics: "losses", means over the block's updates; "episodes", sums
        over the episodes that ended, one a group; "diverged", for each checked
        quantity the first update in which it was not finite, −1 if none.
    """
    block = functools.partial(_block_on_device, setup)
    specs = (SHARED, LEARNER_SPECS, SHARED)
    on_device = sharding.on_devices(setup.num_devices, block, specs, (LEARNER_SPECS, SHARED))
    return on_device(env_params, learner, num_updates)


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
def update(
    setup: Setup, env_params: chex.ArrayTree, learner: Learner
) -> tuple[Learner, dict, dict]:
    """One update on one device: rollout, advantages, N passes of minibatch gradient steps.

    Jitted so that it is traced once, for the shapes of its metrics and for the block's loop.

    Returns:
        The learner, its metrics and {name: bool} whether each checked quantity is finite, all
        of them the same on every device but for the learner's spacecraft.
    """
    learner, steps = rollout(setup, env_params, learner)
    samples = with_advantages(setup, env_params, learner, steps)
    learner, losses_ = optimize(
        setup.policy, setup.settings.ppo, learner, samples, setup.num_devices
    )
    not_finite = {
        "observations": _any_not_finite(steps.inputs.features),
        "rewards": _any_not_finite(steps.reward),
        "losses": _any_not_finite(losses_),
        "parameters": _any_not_finite(learner.params),
    }
    finite = jax.tree.map(lambda x: ~jax.lax.pmax(x, AXIS), not_finite)
    metrics = {
        "losses": jax.lax.pmean(losses_, AXIS),
        "episodes": jax.lax.psum(episode_sums(steps, setup.slices), AXIS),
    }
    return learner.replace(update=learner.update + 1), metrics, finite


def with_advantages(
    setup: Setup, env_params: chex.ArrayTree, learner: Learner, steps: Step
) -> Sample:
    """Values after the rollout, its advantages and the value targets.

    The values are computed a few steps at a time: as many samples as a cache holds.
    """
    env, policy, settings = setup.env, setup.policy, setup.settings

    def value(features):
        return policy.value(learner.params, features)

    def value_of(observation):
        return value(encode(env, policy, env_params, observation).features)

    values = _few_at_a_time(value, steps.inputs.features)
    if settings.task.time_limit_terminates:
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
        discounts(env, env_params, settings.ppo, setup.envs_per_device),
        settings.ppo.gae_lambda,
    )
    samples = Sample(
        inputs=steps.inputs,
        action=steps.action,
        log_probability=steps.log_probability,
        advantage=advantages,
        target=advantages + values,
    )
    return jax.tree.map(lambda x: x.reshape(-1, *x.shape[2:]), samples)


def _few_at_a_time(value, features):
    """``value`` of (steps, envs, features), of up to CACHED of them at once; (steps, envs)."""
    steps, envs, size = features.shape
    together = max(
        n for n in range(1, steps + 1) if steps % n == 0 and (n == 1 or n * envs <= CACHED)
    )
    return jax.lax.map(value, features.reshape(-1, together * envs, size)).reshape(steps, envs)


def discounts(env: Any, env_params: chex.ArrayTree, settings: PPO, count: int) -> chex.Array:
    """(count,) discount of an agent step of each spacecraft; a scalar where it is the same."""
    if settings.discount_period == 0:
        return jnp.array(settings.discount, float)

    def discount(env_params):
        period = env.context(env_params).control_period
        return settings.discount ** (period / settings.discount_period)

    axes = batch.param_axes(env, env_params)
    return jax.vmap(discount, (axes,), axis_size=count)(env_params)


def _any_not_finite(tree):
    return ~jnp.all(jnp.stack([jnp.all(jnp.isfinite(x)) for x in jax.tree.leaves(tree)]))
