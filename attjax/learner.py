"""What a run is made of: its static setup and the learner, one pytree of all that changes."""

import dataclasses
import functools
import itertools

import chex
import jax
import jax.numpy as jnp
import numpy as np
import optax
from flax import struct
from jax.sharding import PartitionSpec

from attjax import vector
from attjax.networks import Policy
from attjax.settings import Settings


@dataclasses.dataclass(frozen=True)
class Setup:
    """The static part of a run.

    Attributes:
        envs: environments that differ in how they step; their episodes start in the same way,
            but for the parameters.
        policy: the one that serves them all.
        settings: of the run.
        num_devices: devices, or CPU cores as devices, that share the spacecraft and each
            minibatch; a divisor of the numbers of both.
    """

    envs: tuple
    policy: Policy
    settings: Settings
    num_devices: int = 1

    @property
    def slices(self) -> list[slice]:
        """Where each environment's spacecraft stand among those of one device."""
        total, groups = self.envs_per_device, len(self.envs)
        bounds = [i * total // groups for i in range(groups + 1)]
        return [slice(a, b) for a, b in itertools.pairwise(bounds)]

    @property
    def group_of_row(self) -> np.ndarray:
        """(envs_per_device,) the number of each spacecraft's environment."""
        return np.repeat(np.arange(len(self.envs)), [s.stop - s.start for s in self.slices])

    @property
    def envs_per_device(self) -> int:
        """Spacecraft of one device."""
        return self.settings.num_envs // self.num_devices


@struct.dataclass
class Learner:
    """All that changes during training.

    Attributes:
        params: {"policy", "value"} network parameters.
        optimizer: {"policy", "value"} Adam's moments and step counts.
        states: batched states of all environments, (num_envs, ...), device by device.
        observation: (num_envs, size) current observations.
        score: (num_envs,) sum of ``info["score"]`` over the current episodes.
        is_whole: (num_envs,) whether the current episodes started at time 0; only these count
            in the metrics.
        key: typed random key.
        update: updates done, int32.
    """

    params: dict
    optimizer: dict
    states: chex.ArrayTree
    observation: chex.Array
    score: chex.Array
    is_whole: chex.Array
    key: chex.PRNGKey
    update: chex.Array


def on_devices(setup: Setup, function, in_specs, out_specs):
    """``function`` on each device's part of its arguments, with the axis ``vector.AXIS``."""
    mesh = vector.mesh(setup.num_devices)
    return jax.shard_map(
        function, mesh=mesh, in_specs=in_specs, out_specs=out_specs, check_vma=False
    )


SHARED, SPLIT = PartitionSpec(), PartitionSpec(vector.AXIS)
LEARNER_SPECS = Learner(SHARED, SHARED, SPLIT, SPLIT, SPLIT, SPLIT, SHARED, SHARED)
"""What is the same on all devices, and what is split."""


def optimizer(settings: Settings) -> optax.GradientTransformation:
    """Adam, annealed linearly over the whole run, with optional gradient clipping."""
    gradient_steps = settings.num_updates * settings.passes * settings.minibatches
    schedule = optax.linear_schedule(
        settings.learning_rate, settings.final_learning_rate, gradient_steps
    )
    clip = optax.identity()
    if settings.max_gradient_norm > 0:
        clip = optax.clip_by_global_norm(settings.max_gradient_norm)
    # As one vector: dozens of small arrays cost more to start on than to work through.
    return optax.flatten(optax.chain(clip, optax.adam(schedule)))


def entropy_coefficient(settings: Settings, update) -> chex.Array:
    """Weight of the entropy bonus in an update, annealed linearly over the whole run."""
    schedule = optax.linear_schedule(
        settings.entropy_coefficient, settings.final_entropy_coefficient, settings.num_updates
    )
    return schedule(update)


@functools.partial(jax.jit, static_argnames="setup")
def init(setup: Setup, env_params: tuple, key: chex.PRNGKey) -> Learner:
    """A learner at its start. ``env_params`` holds one parameter set an environment."""
    start = functools.partial(_init_on_device, setup)
    return on_devices(setup, start, (SHARED, SHARED), LEARNER_SPECS)(env_params, key)


def _init_on_device(setup, env_params, key):
    key, policy_key, value_key, start_key = jax.random.split(key, 4)
    start_key = jax.random.fold_in(start_key, jax.lax.axis_index(vector.AXIS))
    keys = jax.random.split(start_key, setup.envs_per_device)
    observation, states = jax.vmap(functools.partial(_start, setup, stack(env_params)))(
        keys, setup.group_of_row
    )
    context = setup.envs[0].context(env_params[0])
    params = setup.policy.init(policy_key, value_key, observation[0], context)
    return Learner(
        params=params,
        optimizer={name: optimizer(setup.settings).init(p) for name, p in params.items()},
        states=states,
        observation=observation,
        score=jnp.zeros(setup.envs_per_device, observation.dtype),
        is_whole=states.time == 0,
        key=key,
        update=jnp.zeros((), jnp.int32),
    )


def _start(setup, env_params, key, group):
    observation, state = reset(setup, env_params, key, group)
    if setup.settings.stagger_episodes:
        limit = env_params.max_steps_in_episode[group]
        time = jax.random.randint(jax.random.fold_in(key, 0), (), 0, limit)
        state = state.replace(time=jnp.maximum(state.time, time))
    return observation, state


def reset(setup, env_params, key, group):
    """Observation and state at the start of an episode in the environment number ``group``.

    ``env_params`` are those of all environments, as :func:`stack` gives them.
    """
    return setup.envs[0].reset(key, jax.tree.map(lambda x: x[group], env_params))


def stack(trees):
    """One pytree of several like ones, each leaf with a leading axis over them."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)
