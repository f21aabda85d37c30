"""What a run is made of: its static setup and the learner, one pytree of all that changes."""

import dataclasses
import functools
import itertools

import chex
import jax
import jax.numpy as jnp
import optax
from flax import struct

from attjax.networks import Policy
from attjax.settings import Settings


@dataclasses.dataclass(frozen=True)
class Setup:
    """The static part of a run: environments, the policy that serves them all, settings."""

    envs: tuple
    policy: Policy
    settings: Settings

    @property
    def slices(self) -> list[slice]:
        """Where each environment's spacecraft stand among the ``num_envs`` of the batch."""
        total, groups = self.settings.num_envs, len(self.envs)
        bounds = [i * total // groups for i in range(groups + 1)]
        return [slice(a, b) for a, b in itertools.pairwise(bounds)]


@struct.dataclass
class Learner:
    """All that changes during training.

    Attributes:
        params: {"policy", "value"} network parameters.
        optimizer: {"policy", "value"} Adam's moments and step counts.
        env_states: batched states, one pytree an environment.
        observation: (num_envs, size) current observations.
        score: (num_envs,) sum of ``info["score"]`` over the current episodes.
        is_whole: (num_envs,) whether the current episodes started at time 0; only these count
            in the metrics.
        key: typed random key.
        update: updates done, int32.
    """

    params: dict
    optimizer: dict
    env_states: tuple
    observation: chex.Array
    score: chex.Array
    is_whole: chex.Array
    key: chex.PRNGKey
    update: chex.Array


def optimizer(settings: Settings) -> optax.GradientTransformation:
    """Adam, annealed linearly over the whole run, with optional gradient clipping."""
    gradient_steps = settings.num_updates * settings.passes * settings.minibatches
    schedule = optax.linear_schedule(
        settings.learning_rate, settings.final_learning_rate, gradient_steps
    )
    clip = optax.identity()
    if settings.max_gradient_norm > 0:
        clip = optax.clip_by_global_norm(settings.max_gradient_norm)
    return optax.chain(clip, optax.adam(schedule))


def entropy_coefficient(settings: Settings, update) -> chex.Array:
    """Weight of the entropy bonus in an update, annealed linearly over the whole run."""
    schedule = optax.linear_schedule(
        settings.entropy_coefficient, settings.final_entropy_coefficient, settings.num_updates
    )
    return schedule(update)


@functools.partial(jax.jit, static_argnames="setup")
def init(setup: Setup, env_params: tuple, key: chex.PRNGKey) -> Learner:
    """A learner at its start. ``env_params`` holds one parameter set an environment."""
    key, policy_key, value_key, reset_key, time_key = jax.random.split(key, 5)
    reset_keys = jax.random.split(reset_key, setup.settings.num_envs)
    observations, states = [], []
    for env, params, group in zip(setup.envs, env_params, setup.slices):
        observation, state = jax.vmap(env.reset, (0, None))(reset_keys[group], params)
        if setup.settings.stagger_episodes:
            key_, shape = jax.random.fold_in(time_key, group.start), state.time.shape
            time = jax.random.randint(key_, shape, 0, params.max_steps_in_episode)
            state = state.replace(time=jnp.maximum(state.time, time))
        observations.append(observation)
        states.append(state)
    observation = jnp.concatenate(observations)
    context = setup.envs[0].context(env_params[0])
    params = setup.policy.init(policy_key, value_key, observation[0], context)
    return Learner(
        params=params,
        optimizer={name: optimizer(setup.settings).init(p) for name, p in params.items()},
        env_states=tuple(states),
        observation=observation,
        score=jnp.zeros(setup.settings.num_envs, observation.dtype),
        is_whole=episodes_at_start(states),
        key=key,
        update=jnp.zeros((), jnp.int32),
    )


def episodes_at_start(states) -> chex.Array:
    """(num_envs,) whether each spacecraft of the environments' states is at time 0."""
    return jnp.concatenate([state.time for state in states]) == 0
