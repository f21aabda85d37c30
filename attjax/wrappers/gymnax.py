"""The environment with gymnax's own types, for tools that ask for them.

:class:`attjax.AttitudeEnv` has gymnax 1.0's protocol, and what only steps takes it as it is
(``LogWrapper``, ``RolloutWrapper``). What asks for the class of a space takes
:class:`GymnaxEnv`, and what unpacks five values of a step takes :class:`FiveValueEnv`. Both
need gymnax, which no extra of attjax installs.
"""

import dataclasses
import functools
from typing import Any

import chex
import jax
from gymnax.environments import environment, spaces

from attjax.envs.attitude import AttitudeEnv
from attjax.envs.parameters import EnvParams, EnvState
from attjax.envs.spaces import Discrete


class GymnaxEnv(environment.Environment):
    """The environment as one of gymnax 1.0.

    ``info`` is what gymnax's own environments tell, ``terminated``, ``truncated``, ``discount``
    and, after ``step``, ``final_observation``: as much as Brax's state has room for after a reset.

    Args:
        env: by default the paper's, ``AttitudeEnv()``.
        reward_scale: factor of the reward.
        describe: whether ``info`` holds ``score``, ``torque`` and ``outcome`` too.

    Example:
        >>> env = GymnaxEnv()
        >>> env.action_space(env.default_params)
        Discrete(19, dtype=int32)
    """

    def __init__(
        self,
        env: AttitudeEnv | None = None,
        reward_scale: float = 1.0,
        describe: bool = False,
    ):
        super().__init__()
        self.attitude_env = AttitudeEnv() if env is None else env
        self.reward_scale = reward_scale
        self.describe = describe

    @property
    def default_params(self) -> EnvParams:
        """As the environment's, with a plain integer for the time limit: evosax hashes it."""
        env = self.attitude_env
        limit = env.spacecraft.max_steps(env.frameskip)
        return dataclasses.replace(env.default_params, max_steps_in_episode=limit)

    @property
    def name(self) -> str:
        """As the environment's."""
        return self.attitude_env.name

    @property
    def num_actions(self) -> int:
        """As the environment's."""
        return self.attitude_env.num_actions

    @functools.partial(jax.jit, static_argnames="self")
    def step(
        self,
        key: chex.PRNGKey,
        state: EnvState,
        action: chex.Numeric,
        params: EnvParams | None = None,
    ) -> tuple[chex.Array, EnvState, chex.Array, chex.Array, chex.Array, dict[str, Any]]:
        """As the environment's: six values."""
        *results, info = self.attitude_env.step(key, state, action, params)
        return self._told(*results, info=info)

    def step_env(
        self,
        key: chex.PRNGKey,
        state: EnvState,
        action: chex.Numeric,
        params: EnvParams,
    ) -> tuple[chex.Array, EnvState, chex.Array, chex.Array, dict[str, Any]]:
        """As the environment's: five values."""
        *results, info = self.attitude_env.step_env(key, state, action, params)
        return self._told(*results, info=info)

    def _told(self, observation, state, reward, *ends, info):
        terminated = info["terminated"]
        info = {**info, "discount": 1 - terminated.astype(reward.dtype)}
        if not self.describe:
            del info["score"], info["torque"], info["outcome"]
        return observation, state, reward * self.reward_scale, *ends, info

    def reset_env(self, key: chex.PRNGKey, params: EnvParams) -> tuple[chex.Array, EnvState]:
        """As the environment's."""
        return self.attitude_env.reset_env(key, params)

    def observation_space(self, params: EnvParams) -> spaces.Box:
        """The environment's, of gymnax's class."""
        box = self.attitude_env.observation_space(params)
        return spaces.Box(box.low, box.high, box.shape, box.dtype)

    def action_space(self, params: EnvParams | None = None) -> spaces.Discrete | spaces.Box:
        """The environment's, of gymnax's class."""
        space = self.attitude_env.action_space(params)
        if isinstance(space, Discrete):
            return spaces.Discrete(space.n)
        return spaces.Box(space.low, space.high, space.shape, space.dtype)


class FiveValueEnv(GymnaxEnv):
    """The environment with the step of gymnax 0.0.9, which returns one ``done``; as rejax asks.

    The time limit cannot be told from overspeed by ``done``, and so is learned as an end.
    """

    @functools.partial(jax.jit, static_argnames="self")
    def step(
        self,
        key: chex.PRNGKey,
        state: EnvState,
        action: chex.Numeric,
        params: EnvParams | None = None,
    ) -> tuple[chex.Array, EnvState, chex.Array, chex.Array, dict[str, Any]]:
        """Observation (11,), state, reward, done, info."""
        observation, state, reward, terminated, truncated, info = super().step(
            key, state, action, params
        )
        return observation, state, reward, terminated | truncated, info
