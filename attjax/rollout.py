"""Rollouts of several environments side by side, as one batch."""

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax import vector
from attjax.learner import Learner, reset, stack
from attjax.networks import Inputs


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


def rollout(setup, env_params, contexts, learner) -> tuple[Learner, Step]:
    """``rollout_length`` steps of all spacecraft under the current policy.

    Most sample their actions. Those of :func:`greedy_rows` take the most probable one, as in
    flight, so that the learner meets what only the greedy policy does, such as standing still
    where several actions are about equally probable. The advantage is negative there, and the
    update lowers the action. It takes these steps as if they had been sampled.
    """
    greedy = greedy_rows(setup)
    key, device_key = jax.random.split(learner.key)
    device_key = jax.random.fold_in(device_key, jax.lax.axis_index(vector.AXIS))

    def step(learner, key):
        action_key, step_key = jax.random.split(key)
        inputs = encode(setup, contexts, learner.observation)
        log_probabilities = setup.policy.log_probabilities(learner.params, inputs)
        sampled = sample(action_key, log_probabilities)
        most_probable = first_row(log_probabilities == jnp.max(log_probabilities, axis=0))
        action = jnp.where(greedy, most_probable, sampled)
        learner, results = fly(setup, env_params, learner, action, step_key)
        log_probability = pick(log_probabilities, action)
        return learner, Step(inputs, action, log_probability, **results)

    keys = jax.random.split(device_key, setup.settings.rollout_length)
    learner, steps = jax.lax.scan(step, learner, keys)
    return learner.replace(key=key), steps


def fly(setup, env_params, learner, action, key) -> tuple[Learner, dict]:
    """One agent step of all spacecraft, ended episodes restarted; and its part of a Step."""
    step_key, restart_key = jax.random.split(key)
    keys = jax.random.split(step_key, len(action))
    flown = []
    for env, params, part in zip(setup.envs, env_params, setup.slices):
        rows = jax.tree.map(lambda x, part=part: x[part], (keys, learner.states, action))
        flown.append(jax.vmap(env.step_env, (0, 0, 0, None))(*rows, params))
    observation, states, reward, terminated, info = _concatenate(flown)
    score = learner.score + info["score"]
    ended = terminated | info["truncated"]
    results = {
        "reward": reward * setup.settings.reward_scale,
        "terminated": terminated,
        "truncated": info["truncated"],
        "final_observation": observation,
        "score": score,
        "is_whole": learner.is_whole,
        "outcome": info["outcome"],
    }
    all_params, group_of_row = stack(env_params), jnp.asarray(setup.group_of_row)
    observation, states = vector.restart(
        lambda key, row: reset(setup, all_params, key, group_of_row[row]),
        restart_key,
        ended,
        (observation, states),
    )
    learner = learner.replace(
        states=states,
        observation=observation,
        score=jnp.where(ended, 0.0, score),
        is_whole=jnp.where(ended, states.time == 0, learner.is_whole),
    )
    return learner, results


def sample(key, log_probabilities) -> chex.Array:
    """(samples,) random actions, by inversion of the cumulative (actions, samples) probabilities.

    It takes one random number a sample, where the Gumbel trick takes one an action and costs
    more than the physics. Masked actions are never drawn, and always some action is: the
    threshold stays a millionth below the sum, whatever the rounding.
    """
    probabilities = jnp.exp(log_probabilities)
    actions, samples = probabilities.shape
    up_to = np.tri(actions, dtype=probabilities.dtype)
    cumulative = jnp.matmul(up_to, probabilities, precision="highest")
    uniform = jax.random.uniform(key, (samples,), probabilities.dtype)
    threshold = uniform * (1 - 1e-6) * cumulative[-1]
    return first_row((cumulative > threshold) & (probabilities > 0))


def first_row(is_candidate) -> chex.Array:
    """(samples,) the first true row of each column; what argmax gives, but it vectorises."""
    rows = len(is_candidate)
    return jnp.min(jnp.where(is_candidate, jnp.arange(rows)[:, None], rows - 1), axis=0)


def greedy_rows(setup) -> np.ndarray:
    """(envs_per_device,) bool, who acts greedily: ``greedy_share`` of them, spread evenly."""
    rows = np.arange(setup.envs_per_device + 1)
    return np.diff(np.floor(rows * setup.settings.greedy_share)) > 0


def encode(setup, contexts, observation) -> Inputs:
    """Network inputs of a device's (envs, size) observations, each group in its own context."""
    encode_group = jax.vmap(setup.policy.encode, (0, None))
    return _concatenate(
        [encode_group(observation[part], c) for part, c in zip(setup.slices, contexts)]
    )


def episode_sums(setup, steps: Step) -> dict[str, chex.Array]:
    """Sums over the whole episodes that ended in a rollout, one an environment."""
    ended = steps.is_whole & (steps.terminated | steps.truncated)
    ended = ended.astype(steps.score.dtype)
    columns = {
        "episodes": ended,
        "score": ended * steps.score,
        "score_squared": ended * steps.score**2,
        **{name: ended * x for name, x in steps.outcome.items()},
    }
    return {
        name: jnp.stack([jnp.sum(x[:, part]) for part in setup.slices])
        for name, x in columns.items()
    }


def _concatenate(trees):
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *trees)


def pick(log_probabilities, action):
    """(samples,) log probability of each taken action, from those of all (actions, samples).

    A masked sum: gathers and their gradients, scatters, do not vectorise.
    """
    is_taken = jnp.arange(len(log_probabilities))[:, None] == action
    return jnp.sum(jnp.where(is_taken, log_probabilities, 0.0), axis=0)
