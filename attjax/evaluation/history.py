"""Every step of some slews under a controller."""

import functools

import chex
import jax
import jax.numpy as jnp
from flax import struct

from attjax.envs import parameters
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.keys import observation_key, steps_key
from attjax.envs.parameters import EnvParams, EnvState
from attjax.envs.worlds import placed
from attjax.evaluation import flown
from attjax.evaluation.flown import Controller


@struct.dataclass
class History:
    """Every agent step of some slews; fields are (steps, slews, ...), after each step.

    Attributes:
        quaternion: (..., 4) error quaternion.
        angular_velocity: (..., 3) rad/s.
        torque: (..., 3) torque of the action that led there, N m.
        believed: (..., 4) attitude that was believed when it was decided on, so of before.
    """

    quaternion: chex.Array
    angular_velocity: chex.Array
    torque: chex.Array
    believed: chex.Array


@functools.partial(jax.jit, static_argnames=("env", "steps"))
def record(
    controller: Controller,
    env: AttitudeEnv,
    params: EnvParams,
    key: chex.PRNGKey,
    start: EnvState,
    steps: int,
) -> History:
    """Fly slews from a batch of states without ending them early, and keep every step.

    Of slews of :func:`random_slews`, and with the same key, they are the flights of :func:`fly`.
    States that were put together without a world get one of the environment's.
    """
    reset_keys, axes = jax.random.split(key, len(start.time)), parameters.fleet_axes(params)
    if start.plant is None:
        start = jax.vmap(placed, (None, 0, 0, axes))(env, reset_keys, start, params)
    observe = jax.vmap(env.observe, (0, 0, axes))
    observation = observe(jax.vmap(observation_key)(reset_keys), start, params)
    keys = jax.vmap(steps_key)(reset_keys)
    memory = flown.first_memory((controller,), flown.Flown(env, params), len(reset_keys))

    def step(carry, index):
        _, _, state = carry
        memory, results = flown.step((controller,), env, params, (keys, index), carry)
        believed = flown.estimated(memory, state)
        observation, state, _, _, info = results
        history = History(state.quaternion, state.angular_velocity, info["torque"], believed)
        return (memory, observation, state), history

    return jax.lax.scan(step, (memory, observation, start), jnp.arange(steps))[1]


def estimation_errors(start: EnvState, history: History) -> chex.Array:
    """(steps, slews) angle between what was believed at each decision and the truth then, rad.

    Args:
        start: of the slews, as :func:`record` was given it.
        history: of them.
    """
    true = jnp.concatenate([start.quaternion[None], history.quaternion[:-1]])
    return jax.vmap(jax.vmap(flown.angle_between))(history.believed, true)
