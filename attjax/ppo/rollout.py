"""Rollouts: many spacecraft fly under the current policy."""

from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax import sharding
from attjax.envs import batch
from attjax.ppo.networks import Inputs, Policy
from attjax.ppo.train_state import Learner, Setup


@struct.dataclass
class Step:
    """What a rollout keeps of each step; fields are (rollout_length, num_envs, ...)."""

    inputs: Inputs
    action: chex.Array
    log_probability: chex.Array
    reward: chex.Array
    terminated: chex.Array
    truncated: chex.Array
    final_observation: chex.Array
    score: chex.Array
    is_whole: chex.Array
    outcome: dict[str, chex.Array]


def rollout(setup: Setup, env_params: chex.ArrayTree, learner: Learner) -> tuple[Learner, Step]:
    """``rollout_length`` steps of all spacecraft under the current policy.

    Most sample their actions. Those of :func:`greedy_rows` take the most probable one, as in
    flight, so that the learner meets what only the greedy policy does, such as standing still
    where several actions are about equally probable. The advantage is negative there, and the
    update lowers the action. It takes these steps as if they had been sampled.
    """
    env, policy, length = setup.env, setup.policy, setup.settings.ppo.rollout_length
    greedy = greedy_rows(setup.envs_per_device, setup.settings.ppo.greedy_share)
    key, device_key = jax.random.split(learner.key)
    device_key = jax.random.fold_in(device_key, jax.lax.axis_index(sharding.AXIS))
    noise_key, flight_key = jax.random.split(device_key)

    def step(learner, random):
        noise, keys = random
        inputs = encode(env, policy, env_params, learner.observation)
        distribution = policy.distribution(learner.params, inputs)
        action = distribution.draw(noise, greedy)
        command = commanded(env, policy, env_params, action)
        learner, results = fly(env, env_params, learner, command, keys)
        results["reward"] *= setup.settings.task.reward_scale
        log_probability = distribution.log_probability(action)
        return learner, Step(inputs, action, log_probability, **results)

    # Drawn all at once: a small draw costs as much to start as to make.
    shape = (length, setup.envs_per_device)
    noise = policy.distribution_family.noise(noise_key, shape, learner.score.dtype)
    random = (noise, jax.random.split(flight_key, (length, 2)))
    learner, steps = jax.lax.scan(step, learner, random)
    return learner.replace(key=key), steps


def fly(
    env: Any,
    env_params: chex.ArrayTree,
    learner: Learner,
    action: chex.Array,
    keys: chex.PRNGKey,
) -> tuple[Learner, dict]:
    """One agent step of all spacecraft, ended episodes restarted; and its part of a Step.

    ``keys`` are two, of the steps and of the restarts.
    """
    observation, states, reward, terminated, truncated, info = batch.step_and_restart(
        env, env_params, keys, learner.states, action
    )
    score = learner.score + info["score"]
    ended = terminated | truncated
    results = {
        "reward": reward,
        "terminated": terminated,
        "truncated": truncated,
        "final_observation": info["final_observation"],
        "score": score,
        "is_whole": learner.is_whole,
        "outcome": info["outcome"],
    }
    learner = learner.replace(
        states=states,
        observation=observation,
        score=jnp.where(ended, 0.0, score),
        is_whole=jnp.where(ended, env.starts_whole(states), learner.is_whole),
    )
    return learner, results


def greedy_rows(count: int, share: float) -> np.ndarray:
    """(count,) bool, who of the spacecraft acts greedily: a share of them, spread evenly.

    Example:
        >>> greedy_rows(8, 0.25).nonzero()[0].tolist()
        [3, 7]
    """
    return np.diff(np.floor(np.arange(count + 1) * share)) > 0


def encode(env: Any, policy: Policy, env_params: chex.ArrayTree, observation: chex.Array) -> Inputs:
    """Network inputs of a device's (envs, size) observations, each in its own context."""

    def encode_one(observation, env_params):
        return policy.encode(observation, env.context(env_params))

    axes = batch.param_axes(env, env_params)
    return jax.vmap(encode_one, (0, axes))(observation, env_params)


def commanded(
    env: Any, policy: Policy, env_params: chex.ArrayTree, action: chex.Array
) -> chex.Array:
    """What the policy's actions, (envs, ...), command each spacecraft to do."""
    axes = batch.param_axes(env, env_params)

    def command_one(action, env_params):
        return policy.command(action, env.context(env_params))

    return jax.vmap(command_one, (0, axes))(action, env_params)


def episode_sums(steps: Step, groups: list[slice]) -> dict[str, chex.Array]:
    """Sums over the whole episodes that ended in a rollout, one for each group of spacecraft."""
    ended = steps.is_whole & (steps.terminated | steps.truncated)
    ended = ended.astype(steps.score.dtype)
    columns = {
        "episodes": ended,
        "score": ended * steps.score,
        "score_squared": ended * steps.score**2,
        **{name: ended * x for name, x in steps.outcome.items()},
    }
    return {
        name: jnp.stack([jnp.sum(x[:, part]) for part in groups]) for name, x in columns.items()
    }
