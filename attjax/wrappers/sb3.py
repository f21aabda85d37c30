"""Stable-Baselines3 on Gymnasium's vectors: its algorithms take a ``VecEnv`` of their own.

It needs Stable-Baselines3, which no extra of attjax installs.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv

Indices = None | int | Iterable[int]


def as_vec_env(
    vector_env: VectorEnv, reward_scale: float = 1.0, time_limit_terminates: bool = False
) -> VecEnv:
    """A Gymnasium vector as one of Stable-Baselines3, without a copy of the environment.

    Args:
        vector_env: with autoreset mode SAME_STEP, as ``gymnasium.make_vec("attjax/Slew-v0")``.
        reward_scale: factor of the rewards.
        time_limit_terminates: the time limit is learned as an end, which is right for a reward
            that holds a terminal one, as the paper's does. Otherwise Stable-Baselines3 adds
            the value of the final observation, which is right for the logarithmic reward.

    Raises:
        ValueError: the autoreset mode is another.
    """
    return GymnasiumVecEnv(vector_env, reward_scale, time_limit_terminates)


class GymnasiumVecEnv(VecEnv):
    """What :func:`as_vec_env` returns.

    Each environment's info is the vector's of that step; where an episode ended, the ended one's,
    with ``terminal_observation`` and ``TimeLimit.truncated`` (false where the time limit is
    learned as an end). attjax's holds ``is_success``, which Stable-Baselines3 logs.
    """

    def __init__(self, vector_env: VectorEnv, reward_scale: float, time_limit_terminates: bool):
        mode = vector_env.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"autoreset_mode is {mode}; it must be {AutoresetMode.SAME_STEP}")
        self.vector_env = vector_env
        self.reward_scale = np.float32(reward_scale)
        self.time_limit_terminates = time_limit_terminates
        super().__init__(
            vector_env.num_envs,
            vector_env.single_observation_space,
            vector_env.single_action_space,
        )

    def reset(self) -> np.ndarray:
        """Start all episodes; observations (num_envs, ...). The first environment's seed rules."""
        observations, info = self.vector_env.reset(seed=self._seeds[0])
        self.reset_infos = _unstacked(info, self.num_envs)
        self._reset_seeds()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for :meth:`step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Observations, rewards (num_envs,), ends (num_envs,) and a list of infos."""
        observations, rewards, terminated, truncated, info = self.vector_env.step(self._actions)
        ended = terminated | truncated
        infos = _unstacked(info, self.num_envs)
        for i in np.flatnonzero(ended):
            infos[i] |= infos[i].pop("final_info", {})
            infos[i]["terminal_observation"] = infos[i].pop("final_obs")
            infos[i]["TimeLimit.truncated"] = bool(
                truncated[i] and not terminated[i] and not self.time_limit_terminates
            )
        return observations, rewards * self.reward_scale, ended, infos

    def close(self) -> None:
        """Close the vector."""
        self.vector_env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A picture of each environment, where the vector was made with a render mode."""
        frames: Any = self.vector_env.render()
        return list(frames)

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """The vector's attribute, once for each environment, or each environment's own."""
        vector = self.vector_env.unwrapped
        if not hasattr(vector, attr_name) and hasattr(vector, "get_attr"):
            values = vector.get_attr(attr_name)
        else:
            values = [getattr(vector, attr_name)] * self.num_envs
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set the vector's attribute, which all environments share.

        Raises:
            ValueError: the indices leave some out.
        """
        if len(set(self._get_indices(indices))) < self.num_envs:
            raise ValueError(f"indices is {indices!r}; all environments share {attr_name}")
        setattr(self.vector_env.unwrapped, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """The result of each environment's method, as the vector's own ``call`` gives it."""
        vector: Any = self.vector_env.unwrapped
        results = vector.call(method_name, *method_args, **method_kwargs)
        return [results[i] for i in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper], indices: Indices = None
    ) -> list[bool]:
        """No environment is."""
        return [False for _ in self._get_indices(indices)]


def _unstacked(info, num_envs):
    """A Gymnasium vector's info as a list of one for each environment."""
    infos: list[dict[str, Any]] = [{} for _ in range(num_envs)]
    for name, values in info.items():
        if (mask := info.get(f"_{name}")) is None:
            continue  # a mask itself
        if isinstance(values, dict):
            values = _unstacked(values, num_envs)
        for i in np.flatnonzero(mask):
            infos[i][name] = values[i]
    return infos
