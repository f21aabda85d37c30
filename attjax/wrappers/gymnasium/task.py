"""What one spacecraft and a vector of them have in common under Gymnasium: the task."""

import copy
import dataclasses
import functools
import numbers
import os
import sys
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any

import chex
import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import logger, spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from gymnasium.utils.seeding import np_random
from gymnasium.wrappers import TimeLimit
from jax._src.xla_bridge import backends_are_initialized

from attjax.control import assurance
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.parameters import EnvParams, EnvState
from attjax.envs.reward import REWARDS, Transition
from attjax.envs.spaces import Discrete

if TYPE_CHECKING:
    from attjax.wrappers.rendering import Renderer

ROUNDING = 1e-6
"""By how much, relatively, rounding may carry an observation beyond its bounds."""

RENDER_MODES = (None, "rgb_array")


class ForkedError(SystemExit, RuntimeError):
    """JAX was used before this process was forked from another, and would wait here for ever.

    As SystemExit it ends a worker process in one line, and as RuntimeError a worker that looks
    after exceptions can tell its parent.
    """


@dataclasses.dataclass(frozen=True, eq=False)
class Options:
    """What one spacecraft and a vector of them take alike: see :class:`gymnasium_env.SlewEnv`.

    Raises:
        ValueError: one is not as said there.
    """

    frameskip: int = 20
    reward: str | Callable[[Transition], chex.Array] = "paper"
    env: AttitudeEnv | None = None
    params: EnvParams | None = None
    render_mode: str | None = None
    rate_margin: float = 0.99
    actions: str | None = None

    def __post_init__(self):
        reward, margin = self.reward, self.rate_margin
        if not callable(reward) and reward not in REWARDS:
            allowed = ", ".join(map(repr, REWARDS))
            raise ValueError(f"reward is {reward!r}; it must be {allowed} or a function")
        if self.render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode is {self.render_mode!r}; it must be None or 'rgb_array'")
        if not (isinstance(margin, numbers.Real) and 0 < margin <= 1):
            raise ValueError(f"rate_margin is {margin!r}; it must be above 0 and at most 1")
        if self.env is not None and self.actions not in (None, self.env.actions):
            raise ValueError(f"actions is {self.actions!r}; env has {self.env.actions!r} ones")


class Task:
    """A mixin: environment, parameters, spaces, time limit, mask and pictures."""

    metadata: dict[str, Any]
    _spec: EnvSpec | None
    _state: EnvState | None
    _renderer: "Renderer | None"

    def _set_task(self, options: Options, num_envs: int = 1, limit: int | None = None) -> None:
        check_not_forked()
        env = options.env
        if env is None:
            reward = options.reward
            reward = REWARDS[reward] if isinstance(reward, str) else reward
            actions = "discrete" if options.actions is None else options.actions
            env = AttitudeEnv(options.frameskip, reward=reward, actions=actions)
        self._env = env
        self._params = env.default_params if options.params is None else options.params
        self._set_limit(limit)
        env.reset(jax.random.key(0), self._params)  # checks the parameters, which have values here
        self._num_envs, self._rate_margin = num_envs, options.rate_margin
        self._spec = self._state = self._renderer = None
        self.render_mode = options.render_mode
        if self.render_mode is not None:
            _rendering()  # so that a missing package is told of at once
        context = env.context(self._params)
        self.metadata = self.metadata | {"render_fps": float(1 / context.control_period)}

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's, with the time limit that this task has."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = copy.copy(spec)
        if self._spec is not None:
            self._spec.max_episode_steps = int(self._params.max_steps_in_episode)

    def _set_limit(self, limit):
        """Set the time limit, agent steps; None leaves that of the parameters."""
        if limit is not None and limit != int(self._params.max_steps_in_episode):
            limit = jnp.asarray(limit)
            self._params = dataclasses.replace(self._params, max_steps_in_episode=limit)
            self._renderer = None

    def _spaces(self):
        box = self._env.observation_space(self._params)
        low, high = (
            np.asarray(x, np.float32) * np.float32(1 + ROUNDING) for x in (box.low, box.high)
        )
        observation_space, actions = spaces.Box(low, high), self._env.action_space(self._params)
        if isinstance(actions, Discrete):
            return observation_space, spaces.Discrete(actions.n)
        one = np.ones(actions.shape, np.float32)
        return observation_space, spaces.Box(-one, one)

    def _check_reset(self):
        check_not_forked()
        if self._state is None:
            raise ResetNeeded("reset() must come first")

    def _masks(self):
        """(num_envs, actions) bool, or (actions,) of one spacecraft."""
        if self._env.actions == "continuous":
            raise ValueError("action_masks: continuous actions have none")
        self._check_reset()
        return np.array(_allowed(self._env, self._params, self._state, self._rate_margin))

    def _record(self):
        """Note the state for pictures, where there may be any."""
        if self.render_mode is None:
            return
        state = jax.tree.map(np.array, self._state)  # copies: a state is donated to the next step
        if self._renderer is None:
            params = jax.tree.map(np.asarray, self._params)
            self._renderer = _rendering().Renderer(
                params.inertia,
                params.rate_limit,
                params.goal_angle,
                1 / self.metadata["render_fps"],
                int(params.max_steps_in_episode),
                self._num_envs,
            )
        self._renderer.record(
            state.quaternion.reshape(-1, 4),
            state.angular_velocity.reshape(-1, 3),
            state.time.reshape(-1),
        )

    def _frames(self):
        """A picture of each spacecraft; None without a render mode."""
        if self.render_mode is None:
            logger.warn("render() draws nothing: there is no render_mode; say 'rgb_array'")
            return None
        self._check_reset()
        assert self._renderer is not None  # reset() records
        return tuple(self._renderer.frame(i) for i in range(self._num_envs))


def outer_time_limit(env: gymnasium.Env) -> int | None:
    """The least limit of the ``TimeLimit`` wrappers through which ``env.reset`` is being called.

    Gymnasium tells no environment which limit ``make(max_episode_steps=...)`` puts around it, but
    the reward at the limit depends on it. Hence the look at the callers: a wrapper's ``reset``
    calls that of what it wraps.
    """
    limits = []
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        if frame.f_code.co_name == "reset":
            caller = frame.f_locals.get("self")
            if isinstance(caller, TimeLimit) and caller.unwrapped is env:
                limits.append(caller._max_episode_steps)
        frame = frame.f_back
    return min(limits, default=None)


def check_not_forked() -> None:
    """Check that JAX can work in this process.

    Raises:
        ForkedError: it was used before the process was forked.
    """
    if _forked:
        raise ForkedError(
            "attjax: JAX cannot work in a process that was forked after its first use; start "
            'processes with context="spawn" (or make_vec without a vectorization_mode)'
        )


_forked = False


def _note_fork():
    global _forked
    _forked = _forked or backends_are_initialized()


# At import, alone of all modules: a fork is heard of only by who registered before it.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_note_fork)


def _rendering():
    try:
        from attjax.wrappers import rendering
    except ModuleNotFoundError:
        raise DependencyNotInstalled(
            "render_mode='rgb_array' needs matplotlib: install attjax[plot]"
        ) from None
    return rendering


@functools.partial(jax.jit, static_argnames=("env", "margin"))
def _allowed(env, params, states, margin):
    allowed = assurance.rate_mask(env.context(params), margin).allowed
    one = states.angular_velocity.ndim == 1
    return (allowed if one else jax.vmap(allowed))(states.angular_velocity)


def starting_key(seed: int) -> chex.PRNGKey:
    """The key of the first episode after ``reset(seed=seed)`` of one spacecraft."""
    return random_key(np_random(seed)[0])


def random_key(generator: np.random.Generator) -> chex.PRNGKey:
    """A key from a NumPy generator."""
    return jax.random.key(int(generator.integers(2**31)))
