"""Rollouts of several environments side by side, as one batch."""

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax.learner import Learner, episodes_at_start
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
    policy, num_envs = setup.policy, setup.settings.num_envs
    greedy = greedy_rows(setup.settings)

    def step(learner, _):
        key, action_key, step_key = jax.random.split(learner.key, 3)
        inputs = encode(setup, contexts, learner.observation)
        log_probabilities = policy.log_probabilities(learner.params, inputs)
        sampled = jax.random.categorical(action_key, log_probabilities)
        action = jnp.where(greedy, jnp.argmax(log_probabilities, axis=-1), sampled)
        results = [
            jax.vmap(env.step, (0, 0, 0, None))(keys, state, action_, params)
            for env, keys, state, action_, params in zip(
                setup.envs,
                (jax.random.split(step_key, num_envs)[group] for group in setup.slices),
                learner.env_states,
                (action[group] for group in setup.slices),
                env_params,
            )
        ]
        observations, env_states, *rest = zip(*results)
        reward, terminated, truncated, info = map(_concatenate, rest)
        score = learner.score + info["score"]
        step = Step(
            inputs=inputs,
            action=action,
            log_probability=pick(log_probabilities, action),
            reward=reward * setup.settings.reward_scale,
            terminated=terminated,
            truncated=truncated,
            final_observation=info["final_observation"],
            score=score,
            is_whole=learner.is_whole,
            outcome=info["outcome"],
        )
        ended = terminated | truncated
        learner = learner.replace(
            env_states=env_states,
            observation=jnp.concatenate(observations),
            score=jnp.where(ended, 0.0, score),
            is_whole=jnp.where(ended, episodes_at_start(env_states), learner.is_whole),
            key=key,
        )
        return learner, step

    return jax.lax.scan(step, learner, length=setup.settings.rollout_length)


def greedy_rows(settings) -> np.ndarray:
    """(num_envs,) bool, which spacecraft act greedily: ``greedy_share`` of them, spread evenly."""
    count_before = np.floor(np.arange(settings.num_envs + 1) * settings.greedy_share)
    return np.diff(count_before) > 0


def encode(setup, contexts, observation) -> Inputs:
    """Network inputs of the (num_envs, size) observations, each group in its own context."""
    encode_group = jax.vmap(setup.policy.encode, (0, None))
    return _concatenate(
        [encode_group(observation[group], c) for group, c in zip(setup.slices, contexts)]
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
        name: jnp.stack([jnp.sum(x[:, group]) for group in setup.slices])
        for name, x in columns.items()
    }


def _concatenate(trees):
    return jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *trees)


def pick(log_probabilities, action):
    """The log probability of each taken action."""
    return jnp.take_along_axis(log_probabilities, action[..., None], axis=-1)[..., 0]
