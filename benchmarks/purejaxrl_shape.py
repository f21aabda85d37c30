"""A PPO of the well-known shape of PureJaxRL, written anew, as a contender.

One jitted update: the rollout scans over ``vmap(env.step)`` and evaluates policy and value at
each step; the whole batch is shuffled, split into minibatches and scanned over, in each pass;
one ``TrainState`` holds both networks and one Adam with clipping of the global norm. It keeps
no statistics of the episodes.
"""

import functools

import flax.linen as nn
import jax
import jax.numpy as jnp
import optax
from contenders import Workload
from flax import struct
from flax.training.train_state import TrainState

from attjax import AttitudeEnv
from attjax.config.presets import PAPER_FAST

VALUE_WEIGHT = 0.5
DISCOUNT, GAE_LAMBDA, CLIP = PAPER_FAST.ppo.discount, PAPER_FAST.ppo.gae_lambda, PAPER_FAST.ppo.clip


class ActorCritic(nn.Module):
    """Two multilayer perceptrons that share nothing: logits and value."""

    hidden_sizes: tuple[int, ...]
    num_actions: int

    @nn.compact
    def __call__(self, x):
        """Logits (..., actions) and values (...)."""
        return self._mlp(x, self.num_actions, 0.01), self._mlp(x, 1, 1.0)[..., 0]

    def _mlp(self, x, outputs, output_scale):
        for size in self.hidden_sizes:
            x = nn.relu(nn.Dense(size, kernel_init=nn.initializers.orthogonal(2**0.5))(x))
        return nn.Dense(outputs, kernel_init=nn.initializers.orthogonal(output_scale))(x)


@struct.dataclass
class Transition:
    """A step of the rollout; fields are (rollout_length, num_envs, ...)."""

    observation: jax.Array
    action: jax.Array
    log_probability: jax.Array
    value: jax.Array
    reward: jax.Array
    done: jax.Array


@struct.dataclass
class Runner:
    """All that changes during training."""

    train_state: TrainState
    env_states: struct.PyTreeNode
    observation: jax.Array
    key: jax.Array


def prepare(workload: Workload):
    """A function that runs one update."""
    env = AttitudeEnv(frameskip=20)
    runner = jax.jit(init, static_argnums=(0, 1))(env, workload, jax.random.key(0))
    update = jax.jit(functools.partial(train, env, workload), donate_argnums=0)
    compiled = update.lower(runner).compile()

    def run():
        nonlocal runner
        runner = jax.block_until_ready(compiled(runner))

    return run


def init(env, workload, key) -> Runner:
    """Fresh networks, optimizer and environments."""
    key, network_key, reset_key = jax.random.split(key, 3)
    keys = jax.random.split(reset_key, workload.num_envs)
    observation, env_states = jax.vmap(env.reset, (0, None))(keys, env.default_params)
    network = ActorCritic(workload.hidden_sizes, env.num_actions)
    transformation = optax.chain(
        optax.clip_by_global_norm(PAPER_FAST.ppo.max_gradient_norm),
        optax.adam(PAPER_FAST.ppo.learning_rate, eps=1e-5),
    )
    params = network.init(network_key, observation)
    train_state = TrainState.create(apply_fn=network.apply, params=params, tx=transformation)
    return Runner(train_state, env_states, observation, key)


def train(env, workload, runner: Runner) -> Runner:
    """One update."""
    runner, transitions = jax.lax.scan(
        functools.partial(env_step, env, workload.num_envs), runner, length=workload.rollout_length
    )
    _, last_value = runner.train_state.apply_fn(runner.train_state.params, runner.observation)
    advantages = generalized_advantages(transitions, last_value)
    batch = (transitions, advantages, advantages + transitions.value)
    batch = jax.tree.map(lambda x: x.reshape(workload.steps, *x.shape[2:]), batch)

    def one_pass(train_state, key):
        order = jax.random.permutation(key, workload.steps)
        shape = (workload.minibatches, workload.minibatch_size)
        minibatches = jax.tree.map(lambda x: x[order].reshape(*shape, *x.shape[1:]), batch)
        return jax.lax.scan(gradient_step, train_state, minibatches)

    key, pass_key = jax.random.split(runner.key)
    keys = jax.random.split(pass_key, workload.passes)
    train_state, _ = jax.lax.scan(one_pass, runner.train_state, keys)
    return runner.replace(train_state=train_state, key=key)


def env_step(env, num_envs, runner: Runner, _) -> tuple[Runner, Transition]:
    """One agent step of all environments, each of which resets itself."""
    key, action_key, step_key = jax.random.split(runner.key, 3)
    logits, value = runner.train_state.apply_fn(runner.train_state.params, runner.observation)
    action = jax.random.categorical(action_key, logits)
    observation, env_states, reward, terminated, truncated, _ = jax.vmap(env.step, (0, 0, 0, None))(
        jax.random.split(step_key, num_envs), runner.env_states, action, env.default_params
    )
    transition = Transition(
        observation=runner.observation,
        action=action,
        log_probability=taken(nn.log_softmax(logits), action),
        value=value,
        reward=reward * PAPER_FAST.task.reward_scale,
        done=terminated | truncated,
    )
    return runner.replace(env_states=env_states, observation=observation, key=key), transition


def generalized_advantages(transitions: Transition, last_value):
    """GAE; an end of an episode, for whatever reason, has no future."""

    def backward(carry, step):
        advantage, next_value = carry
        future = jnp.where(step.done, 0.0, 1.0)
        delta = step.reward + DISCOUNT * future * next_value - step.value
        advantage = delta + DISCOUNT * GAE_LAMBDA * future * advantage
        return (advantage, step.value), advantage

    start = (jnp.zeros_like(last_value), last_value)
    return jax.lax.scan(backward, start, transitions, reverse=True)[1]


def gradient_step(train_state: TrainState, minibatch):
    """One step of Adam on a minibatch."""
    gradients = jax.grad(loss)(train_state.params, train_state.apply_fn, *minibatch)
    return train_state.apply_gradients(grads=gradients), None


def loss(params, apply, transitions: Transition, advantages, targets):
    """Clipped objective, clipped value loss and entropy bonus."""
    logits, value = apply(params, transitions.observation)
    log_probabilities = nn.log_softmax(logits)
    log_probability = taken(log_probabilities, transitions.action)
    ratio = jnp.exp(log_probability - transitions.log_probability)
    advantages = (advantages - jnp.mean(advantages)) / (jnp.std(advantages) + 1e-8)
    clipped_ratio = jnp.clip(ratio, 1 - CLIP, 1 + CLIP)
    objective = jnp.mean(jnp.minimum(ratio * advantages, clipped_ratio * advantages))
    near_value = transitions.value + jnp.clip(value - transitions.value, -CLIP, CLIP)
    errors = jnp.maximum((value - targets) ** 2, (near_value - targets) ** 2)
    entropy = -jnp.mean(jnp.sum(jnp.exp(log_probabilities) * log_probabilities, axis=-1))
    return (
        -objective
        + VALUE_WEIGHT * 0.5 * jnp.mean(errors)
        - PAPER_FAST.ppo.entropy_coefficient * entropy
    )


def taken(log_probabilities, action):
    """The log probability of each taken action."""
    return jnp.take_along_axis(log_probabilities, action[..., None], axis=-1)[..., 0]
