"""What a run is made of: its static setup and the learner, one pytree of all that changes."""

import dataclasses
import functools
import itertools
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
import optax
from flax import struct

from attjax import sharding
from attjax.config.settings import PPO, Settings
from attjax.envs import batch
from attjax.ppo.networks import Policy
from attjax.sharding import SHARED, SPLIT


@dataclasses.dataclass(frozen=True)
class Setup:
    """The static part of a run.

    Attributes:
        env: the environment. Parameters in which the spacecraft differ have a leading axis over
            those of one device.
        policy: what flies it.
        settings: of the run.
        groups: of spacecraft, equal in number, that the metrics are told apart by.
        num_devices: devices, or CPU cores as devices, that share the spacecraft and each
            minibatch; a divisor of the numbers of both.

    Raises:
        ValueError: a device has fewer spacecraft than there are groups.
    """

    env: Any
    policy: Policy
    settings: Settings
    groups: int = 1
    num_devices: int = 1

    def __post_init__(self):
        if self.envs_per_device < self.groups:
            raise ValueError(
                f"num_devices is {self.num_devices}, for {self.envs_per_device} spacecraft each; "
                f"they must be at least {self.groups}, one for each group"
            )

    @property
    def slices(self) -> list[slice]:
        """Where each group's spacecraft stand among those of one device."""
        bounds = [i * self.envs_per_device // self.groups for i in range(self.groups + 1)]
        return [slice(a, b) for a, b in itertools.pairwise(bounds)]

    @property
    def group_of_row(self) -> np.ndarray:
        """(envs_per_device,) the number of each spacecraft's group."""
        return np.repeat(np.arange(self.groups), [s.stop - s.start for s in self.slices])

    @property
    def envs_per_device(self) -> int:
        """Spacecraft of one device."""
        return self.settings.ppo.num_envs // self.num_devices


class Learner(struct.PyTreeNode):
    """All that changes during training.

    Attributes:
        params: {"policy", "value"} network parameters.
        optimizer: {"policy", "value"} Adam's moments and step counts.
        states: batched states of all spacecraft, (num_envs, ...), device by device.
        observation: (num_envs, size) current observations.
        score: (num_envs,) sum of ``info["score"]`` over the current episodes.
        is_whole: (num_envs,) whether the current episodes began as the environment's
            ``starts_whole`` asks; only these count in the metrics.
        key: typed random key.
        update: updates done, int32.
    """

    params: chex.ArrayTree
    optimizer: chex.ArrayTree
    states: chex.ArrayTree
    observation: chex.Array
    score: chex.Array
    is_whole: chex.Array
    key: chex.PRNGKey
    update: chex.Array


LEARNER_SPECS = Learner(SHARED, SHARED, SPLIT, SPLIT, SPLIT, SPLIT, SHARED, SHARED)
"""What is the same on all devices, and what is split."""


def optimizer(settings: PPO) -> optax.GradientTransformation:
    """A network's Adam, annealed linearly over the whole run, with optional gradient clipping."""
    clip = optax.identity()
    if settings.max_gradient_norm > 0:
        clip = optax.clip_by_global_norm(settings.max_gradient_norm)
    return optax.chain(clip, optax.adam(functools.partial(learning_rate, settings)))


def learning_rate(settings: PPO, gradient_step: chex.Array | int) -> chex.Array:
    """Adam's learning rate in a gradient step, annealed linearly over the whole run."""
    schedule = optax.linear_schedule(
        settings.learning_rate, settings.final_learning_rate, settings.gradient_steps
    )
    return schedule(gradient_step)


def entropy_coefficient(settings: PPO, update: chex.Array) -> chex.Array:
    """Weight of the entropy bonus in an update, annealed linearly over the whole run."""
    schedule = optax.linear_schedule(
        settings.entropy_coefficient, settings.final_entropy_coefficient, settings.num_updates
    )
    return schedule(update)


@functools.partial(jax.jit, static_argnames="setup", compiler_options=sharding.RUN_ONCE)
def init(setup: Setup, env_params: chex.ArrayTree, key: chex.PRNGKey) -> Learner:
    """A learner at its start, for parameters as :class:`Setup` describes them."""
    start = functools.partial(_init_on_device, setup)
    on_device = sharding.on_devices(setup.num_devices, start, (SHARED, SHARED), LEARNER_SPECS)
    return on_device(env_params, key)


@functools.partial(jax.jit, static_argnames="setup", compiler_options=sharding.RUN_ONCE)
def restarted(
    setup: Setup, env_params: chex.ArrayTree, learner: Learner, key: chex.PRNGKey
) -> Learner:
    """The learner with all spacecraft, which may be others, at the start of an episode."""

    def restart(env_params, learner, key):
        observation, states = _starts(setup, env_params, key)
        return learner.replace(
            states=states,
            observation=observation,
            score=jnp.zeros_like(learner.score),
            is_whole=setup.env.starts_whole(states),
        )

    specs = SHARED, LEARNER_SPECS, SHARED
    on_device = sharding.on_devices(setup.num_devices, restart, specs, LEARNER_SPECS)
    return on_device(env_params, learner, key)


def _starts(setup, env_params, key):
    """Observations and states of a device's spacecraft at the start of an episode."""
    env, key = setup.env, jax.random.fold_in(key, jax.lax.axis_index(sharding.AXIS))
    keys = jax.random.split(key, setup.envs_per_device)
    start = functools.partial(_start, env, setup.settings.task.stagger_episodes)
    return jax.vmap(start, (0, batch.param_axes(env, env_params)))(keys, env_params)


def _init_on_device(setup, env_params, key):
    env, settings = setup.env, setup.settings
    key, policy_key, value_key, start_key = jax.random.split(key, 4)
    observation, states = _starts(setup, env_params, start_key)
    context = env.context(batch.params_of(env, env_params, 0))
    params = setup.policy.init(policy_key, value_key, observation[0], context)
    adam = optimizer(settings.ppo)
    return Learner(
        params=params,
        optimizer={name: adam.init(network) for name, network in params.items()},
        states=states,
        observation=observation,
        score=jnp.zeros(setup.envs_per_device, observation.dtype),
        is_whole=env.starts_whole(states),
        key=key,
        update=jnp.zeros((), jnp.int32),
    )


def _start(env, is_staggered, key, env_params):
    """The first episode of a spacecraft; if staggered, at a random time of it."""
    observation, state = env.reset(key, env_params)
    if is_staggered:
        limit = env_params.max_steps_in_episode
        time = jax.random.randint(jax.random.fold_in(key, 0), (), 0, limit)
        state = state.replace(time=jnp.maximum(state.time, time))
    return observation, state
