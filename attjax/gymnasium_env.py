"""The slew task for Gymnasium: one spacecraft, or many in one jitted call.

Importing this module registers ``attjax/Slew-v0`` for ``gymnasium.make`` and
``gymnasium.make_vec``. It needs the extra ``gym``.
"""

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from attjax import checks, programs
from attjax.env import AttitudeEnv
from attjax.reward import REWARDS
from attjax.specification import integer

ID = "attjax/Slew-v0"
ROUNDING = 1e-6
"""By how much, relatively, rounding may carry an observation beyond its bounds."""


class SlewEnv(gymnasium.Env):
    """One spacecraft on one slew after another.

    Observations are Eq. 11, (11,) float32; actions are rows of Table 1. ``info`` holds floats
    that describe the spacecraft after the step: ``score``, the reward of Eq. 12–13,
    ``success_rate`` and ``overspeed_rate``, 0 or 1, and ``terminal_error_deg``.

    Args:
        frameskip: torque-free RK4 steps in an agent step: 20 is 11.43 Hz, 5 is 40 Hz.
        reward: "paper", "logarithmic" or a function, as in :mod:`attjax.reward`.
        env: an environment of one's own, in place of what these two describe.
        params: :class:`attjax.EnvParams` of one's own spacecraft; by default the paper's.

    Raises:
        ValueError: an argument is not as said.

    Example:
        >>> env = gymnasium.make("attjax/Slew-v0", frameskip=5)
        >>> observation, _ = env.reset(seed=0)
        >>> env.step(1)[2:4]
        (False, False)
    """

    metadata = {"render_modes": []}  # noqa: RUF012 (Gymnasium's way)

    def __init__(self, frameskip=20, reward="paper", env=None, params=None):
        self._env, self._params = _environment(frameskip, reward, env, params)
        self.observation_space, self.action_space = _spaces(self._env, self._params)
        self._state = None

    def reset(self, *, seed=None, options=None):
        """Start an episode. Returns the observation and an empty info.

        Args:
            seed: of this and all later episodes; None goes on as seeded before.
            options: there are none.

        Raises:
            ValueError: there are options.
        """
        _refuse(options)
        super().reset(seed=seed if integer(seed) is None else integer(seed))
        observation, self._state = programs.reset(self._env, self._params, _key(self.np_random))
        return np.array(observation), {}

    def step(self, action):
        """One agent step.

        Returns:
            Observation (11,), reward, terminated, truncated, info.

        Raises:
            ValueError: the action is no integer of the space.
            gymnasium.error.ResetNeeded: there was no reset yet.
        """
        _check_reset(self._state)
        action = checks.action(action, int(self.action_space.n))
        self._state, (observation, reward, terminated, truncated, info) = programs.step(
            self._env, self._params, self._state, action
        )
        info = {name: float(x) for name, x in info.items()}
        return np.array(observation), float(reward), bool(terminated), bool(truncated), info


class SlewVectorEnv(VectorEnv):
    """Many spacecraft, stepped together by one compiled program.

    An episode that ends is followed by a fresh one in the same step: the observation is the
    new episode's, and ``info["final_obs"]`` (an array of objects) and ``info["final_info"]``
    hold the ended one's where ``info["_final_obs"]``; all as in Gymnasium's own vectors.
    ``info`` is that of :class:`SlewEnv` with (num_envs,) arrays.

    Args:
        num_envs: spacecraft.
        frameskip, reward, env, params: as :class:`SlewEnv`; the params are the same for all.
        max_episode_steps: time limit, agent steps, in place of that of the params.

    Raises:
        ValueError: an argument is not as said.

    Example:
        >>> envs = gymnasium.make_vec("attjax/Slew-v0", num_envs=3)
        >>> observations, _ = envs.reset(seed=0)
        >>> envs.step(np.array([0, 1, 18]))[0].shape
        (3, 11)
    """

    metadata = {  # noqa: RUF012 (Gymnasium's way)
        "render_modes": [],
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs=1,
        frameskip=20,
        reward="paper",
        env=None,
        params=None,
        max_episode_steps=None,
    ):
        if (integer(num_envs) or 0) < 1:
            raise ValueError(f"num_envs is {num_envs!r}; it must be a positive integer")
        env, params = _environment(frameskip, reward, env, params, max_episode_steps)
        self.num_envs = integer(num_envs)
        self._env, self._params = env, params
        self.single_observation_space, self.single_action_space = _spaces(env, params)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._states = None

    def reset(self, *, seed=None, options=None):
        """Start all episodes. Returns the observations (num_envs, 11) and an empty info.

        Args:
            seed: an integer, of these and all later episodes; None goes on as seeded before.
            options: there are none.

        Raises:
            ValueError: there are options, or the seed is no integer.
        """
        _refuse(options)
        if seed is not None and integer(seed) is None:
            raise ValueError(f"seed is {seed!r}; it must be an integer, one for all environments")
        super().reset(seed=integer(seed))
        self._key, observations, self._states = programs.reset_batch(
            self._env, self._params, _key(self.np_random), self.num_envs
        )
        return np.array(observations), {}

    def step(self, actions):
        """One agent step of all spacecraft.

        Args:
            actions: (num_envs,) integers, rows of Table 1.

        Returns:
            Observations (num_envs, 11); rewards, terminated and truncated, each (num_envs,);
            info.

        Raises:
            ValueError: the actions are no such integers.
            gymnasium.error.ResetNeeded: there was no reset yet.
        """
        _check_reset(self._states)
        actions = checks.actions(actions, self.num_envs, int(self.single_action_space.n))
        self._key, self._states, results = programs.step_batch(
            self._env, self._params, self._key, self._states, actions
        )
        final_observations, final_info, *results = jax.tree.map(np.array, results)
        ended = results[2] | results[3]
        return (*results, _vector_info(ended, final_observations, final_info))


def _environment(frameskip, reward, env, params, max_episode_steps=None):
    if not callable(reward) and reward not in REWARDS:
        allowed = ", ".join(map(repr, REWARDS))
        raise ValueError(f"reward is {reward!r}; it must be {allowed} or a function")
    if env is None:
        env = AttitudeEnv(frameskip, reward=REWARDS.get(reward, reward))
    params = env.default_params if params is None else params
    if max_episode_steps is not None:
        params = params.replace(max_steps_in_episode=jnp.asarray(max_episode_steps))
    env.reset(jax.random.key(0), params)  # checks the parameters, which have values here
    return env, params


def _spaces(env, params):
    box = env.observation_space(params)
    low, high = (np.asarray(x, np.float32) * np.float32(1 + ROUNDING) for x in (box.low, box.high))
    return spaces.Box(low, high), spaces.Discrete(env.action_space(params).n)


def _refuse(options):
    if options:
        raise ValueError(f"options is {options!r}; there are none")


def _check_reset(state):
    if state is None:
        raise ResetNeeded("reset() must come before the first step()")


def _vector_info(ended, final_observations, after_step):
    """Gymnasium's info of a step: values beside masks that say whose they are.

    As in Gymnasium's own vectors, an ended episode's are in ``final_info`` alone.
    """
    info = _masked(after_step, ~ended)
    if ended.any():
        final_obs = np.full(len(ended), None, object)
        for i in np.flatnonzero(ended):
            final_obs[i] = final_observations[i]
        final_info = _masked(after_step, ended)
        info |= {"final_obs": final_obs, "_final_obs": ended}
        info |= {"final_info": final_info, "_final_info": ended.copy()}
    return info


def _masked(values, mask):
    values = {name: np.where(mask, x, x.dtype.type(0)) for name, x in values.items()}
    return values | {f"_{name}": mask.copy() for name in values}


def _key(generator):
    return jax.random.key(int(generator.integers(2**31)))


gymnasium.register(
    ID,
    entry_point=f"{__name__}:SlewEnv",
    vector_entry_point=f"{__name__}:SlewVectorEnv",
)
