"""One spacecraft on one slew after another, under Gymnasium."""

from collections.abc import Callable
from typing import Any

import chex
import gymnasium
import numpy as np

from attjax import checks
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.keys import steps_key
from attjax.envs.parameters import EnvParams
from attjax.envs.reward import Transition
from attjax.values import integer
from attjax.wrappers import compiled
from attjax.wrappers.gymnasium.task import (
    Options,
    Task,
    check_not_forked,
    outer_time_limit,
    random_key,
)

ID, CONTINUOUS_ID = "attjax/Slew-v0", "attjax/SlewContinuous-v0"


class SlewEnv(Task, gymnasium.Env):
    """One spacecraft on one slew after another.

    Observations are Eq. 11, (11,) float32; actions are rows of Table 1, or continuous, (3,)
    fractions of the largest torque about each body axis, clipped to [−1, 1]. ``info`` holds NumPy
    scalars that describe the spacecraft after the step: ``score``, the reward of Eq. 12–13,
    ``success_rate`` and ``overspeed_rate``, 0 or 1, ``terminal_error_deg``, and ``is_success``, the
    success rate by the name that Stable-Baselines3 logs.

    The time limit is one: that of ``gymnasium.make(max_episode_steps=...)``, or of any other
    ``gymnasium.wrappers.TimeLimit``, takes the place of the task's own, and the last reward is
    given at it.

    Args:
        frameskip: torque-free RK4 steps in an agent step: 20 is 11.43 Hz, 5 is 40 Hz.
        reward: "paper", "logarithmic" or a function, as in :mod:`attjax.envs.reward`.
        env: an environment of one's own, in place of what these two describe.
        params: :class:`attjax.EnvParams` of one's own spacecraft; by default the paper's.
        render_mode: None, or "rgb_array" for pictures, which need the extra ``plot``.
        rate_margin: fraction of the rate limit that :meth:`action_masks` keeps.
        actions: "discrete" or "continuous"; by default those of ``env``, or discrete.

    Raises:
        ValueError: an argument is not as said.
        gymnasium.error.DependencyNotInstalled: pictures are asked for without matplotlib.

    Example:
        >>> env = gymnasium.make("attjax/Slew-v0", frameskip=5)
        >>> observation, _ = env.reset(seed=0)
        >>> env.step(1)[2:4]
        (False, False)
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012 (Gymnasium's way)

    def __init__(
        self,
        frameskip: int = 20,
        reward: str | Callable[[Transition], chex.Array] = "paper",
        env: AttitudeEnv | None = None,
        params: EnvParams | None = None,
        render_mode: str | None = None,
        rate_margin: float = 0.99,
        actions: str | None = None,
    ):
        self._set_task(Options(frameskip, reward, env, params, render_mode, rate_margin, actions))
        self._own_limit = int(self._params.max_steps_in_episode)
        self.observation_space, self.action_space = self._spaces()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode. Returns the observation and an empty info.

        Args:
            seed: of this and all later episodes; None goes on as seeded before.
            options: there are none.

        Raises:
            ValueError: there are options.
        """
        check_not_forked()
        if options:
            raise ValueError(f"options is {options!r}; there are none")
        super().reset(seed=seed if integer(seed) is None else integer(seed))
        self._set_limit(outer_time_limit(self) or self._own_limit)
        key = random_key(self.np_random)
        self._steps_key = steps_key(key)
        observation, self._state = compiled.reset(self._env, self._params, key)
        self._record()
        return np.array(observation), {}

    def step(self, action: chex.Numeric) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One agent step.

        Args:
            action: an integer of the space, or an array that holds one; (3,) real numbers where
                actions are continuous.

        Returns:
            Observation (11,), reward, terminated, truncated, info.

        Raises:
            ValueError: the action is no integer of the space, or no three finite numbers.
            gymnasium.error.ResetNeeded: there was no reset yet.
        """
        self._check_reset()
        if isinstance(self.action_space, gymnasium.spaces.Discrete):
            action = checks.action(action, int(self.action_space.n))
        else:
            action = checks.fractions("action", action, (3,))
        self._state, (observation, reward, terminated, truncated, info) = compiled.step(
            self._env, self._params, self._steps_key, self._state, action
        )
        self._record()
        info = {name: np.asarray(x)[()] for name, x in info.items()}
        return np.array(observation), float(reward), bool(terminated), bool(truncated), info

    def action_masks(self) -> np.ndarray:
        """(actions,) bool: the actions after which coasting keeps within the rate limit.

        As :func:`attjax.control.assurance.rate_mask` says, at the fraction ``rate_margin`` of the
        limit; the name is the one that MaskablePPO of sb3-contrib looks for.

        Raises:
            ValueError: actions are continuous.
            gymnasium.error.ResetNeeded: there was no reset yet.
        """
        return self._masks()

    def render(self) -> np.ndarray | None:
        """A picture of the spacecraft as it is, (360, 640, 3) uint8; None without a render mode."""
        frames = self._frames()
        return None if frames is None else frames[0]
