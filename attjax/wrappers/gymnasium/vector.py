"""The slew task for Gymnasium: many spacecraft in one jitted call."""

from collections.abc import Sequence
from typing import Any

import chex
import jax
import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from attjax import checks
from attjax.values import integer
from attjax.wrappers import compiled
from attjax.wrappers.gymnasium.task import Options, Task, check_not_forked, random_key, starting_key

EACH_ITS_OWN = ("action_masks", "render")
"""Methods whose result has a part for each spacecraft."""


class SlewVectorEnv(Task, VectorEnv):
    """Many spacecraft, stepped together by one compiled program.

    Where an episode ends, the autoreset mode says what follows, exactly as in Gymnasium's own
    vectors. SAME_STEP: a fresh one in the same step; the observation is the new episode's, and
    ``info["final_obs"]`` (an array of objects) and ``info["final_info"]`` hold the ended one's
    where ``info["_final_obs"]``. NEXT_STEP: the next step starts a fresh one, whatever its
    action, with reward 0. DISABLED: nothing, until ``reset`` with a mask.
    ``info`` is that of :class:`attjax.wrappers.gymnasium.SlewEnv` with (num_envs,) arrays.

    Args:
        num_envs: spacecraft.
        max_episode_steps: time limit, agent steps; None leaves the task's.
        autoreset_mode: a ``gymnasium.vector.AutoresetMode`` or its value, as "NextStep".
        options: ``frameskip``, ``reward``, ``env``, ``params``, ``render_mode``, ``rate_margin``
            and ``actions``, as :class:`attjax.wrappers.gymnasium.SlewEnv`; the same for all.

    Raises:
        ValueError: an argument is not as said.

    Example:
        >>> import gymnasium
        >>> envs = gymnasium.make_vec("attjax.wrappers.gymnasium:attjax/Slew-v0", num_envs=3)
        >>> observations, _ = envs.reset(seed=0)
        >>> envs.step(np.array([0, 1, 18]))[0].shape
        (3, 11)
    """

    metadata = {  # noqa: RUF012 (Gymnasium's way)
        "render_modes": ["rgb_array"],
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }
    _key: chex.PRNGKey
    _observations: chex.Array
    _ended: np.ndarray

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        **options: Any,
    ):
        self.num_envs = _positive("num_envs", num_envs)
        self.autoreset_mode = _mode(autoreset_mode)
        self.metadata = self.metadata | {"autoreset_mode": self.autoreset_mode}
        limit = None if max_episode_steps == -1 else max_episode_steps  # -1: as gymnasium.make
        self._set_task(Options(**options), self.num_envs, limit)
        self.single_observation_space, self.single_action_space = self._spaces()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start episodes. Returns the observations (num_envs, 11) and an empty info.

        Args:
            seed: an integer, of these and all later episodes; a list of one for each spacecraft,
                whose start is that of a :class:`attjax.wrappers.gymnasium.SlewEnv` of that
                seed; None goes on as seeded before, in the list too.
            options: ``{"reset_mask": (num_envs,) bool}`` resets only where it is true.

        Raises:
            ValueError: options or seed are not as said.
            gymnasium.error.ResetNeeded: there is a mask, but there was no reset yet.
        """
        check_not_forked()
        mask = self._reset_mask(options)
        keys = self._starting_keys(seed)
        fresh = compiled.reset_batch(self._env, self._params, keys)
        if mask is not None:
            fresh = compiled.choose(mask, fresh, (self._observations, self._state))
        self._observations, self._state = fresh
        self._ended = np.zeros(self.num_envs, bool) if mask is None else self._ended & ~mask
        self._record()
        return np.array(self._observations), {}

    def step(
        self, actions: npt.ArrayLike
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One agent step of all spacecraft.

        Args:
            actions: (num_envs,) integers, rows of Table 1; (num_envs, 3) real numbers where they
                are continuous.

        Returns:
            Observations (num_envs, 11); rewards, terminated and truncated, each (num_envs,);
            info.

        Raises:
            ValueError: the actions are no such array; with autoreset mode DISABLED, an episode
                ended and was not reset.
            gymnasium.error.ResetNeeded: there was no reset yet.
        """
        self._check_reset()
        if isinstance(self.single_action_space, spaces.Discrete):
            actions = checks.actions(actions, self.num_envs, int(self.single_action_space.n))
        else:
            actions = checks.fractions("actions", actions, (self.num_envs, 3))
        inputs = self._env, self._params, self._key, self._state, actions
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            self._key, self._state, results = compiled.step_batch(*inputs)
            final_observations, described, *results = results
        else:
            if self.autoreset_mode == AutoresetMode.DISABLED and self._ended.any():
                ended = np.flatnonzero(self._ended).tolist()
                raise ValueError(f"episodes of {ended} ended; reset them with options=reset_mask")
            self._key, self._state, results = compiled.step_batch_later_reset(*inputs, self._ended)
            described, *results = results
        self._observations = results[0]
        described, results = jax.tree.map(np.array, (described, results))
        before, self._ended = self._ended, results[2] | results[3]
        self._record()
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            return *results, _same_step_info(self._ended, np.array(final_observations), described)
        return *results, _masked(described, ~before)

    def action_masks(self) -> np.ndarray:
        """(num_envs, actions) bool: what the rate mask allows, as in :class:`SlewEnv`."""
        return self._masks()

    def render(self) -> tuple[np.ndarray, ...] | None:
        """A picture of each spacecraft, a tuple of (360, 640, 3) uint8 arrays."""
        return self._frames()

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """A method's result, or an attribute, for each spacecraft, as Gymnasium's own vectors."""
        value = getattr(self, name)
        value = value(*args, **kwargs) if callable(value) else value
        return tuple(value) if name in EACH_ITS_OWN else (value,) * self.num_envs

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute for each spacecraft, a tuple."""
        return self.call(name)

    def _reset_mask(self, options):
        if not options:
            return None
        mask = options.get("reset_mask")
        fits = isinstance(mask, np.ndarray) and mask.dtype == bool
        fits = fits and mask.shape == (self.num_envs,) and mask.any()
        if set(options) != {"reset_mask"} or not fits:
            raise ValueError(
                f"options is {options!r}; it must be {{'reset_mask': an array of {self.num_envs} "
                f"booleans, not all false}}"
            )
        self._check_reset()
        return mask

    def _starting_keys(self, seed):
        """A key for each spacecraft; also sets the key of all later episodes."""
        if _is_seed(seed):
            super().reset(seed=integer(seed))
            self._key, key = jax.random.split(random_key(self.np_random))
            return jax.random.split(key, self.num_envs)
        seeds = list(seed) if np.ndim(seed) == 1 else []
        if len(seeds) != self.num_envs or not all(map(_is_seed, seeds)):
            raise ValueError(
                f"seed is {seed!r}; it must be an integer, or a list of {self.num_envs} of them"
            )
        keys = [random_key(self.np_random) if x is None else starting_key(int(x)) for x in seeds]
        if None not in seeds:
            together = np.random.SeedSequence([int(x) for x in seeds])
            super().reset(seed=int(together.generate_state(1)[0]))
        self._key = random_key(self.np_random)
        return jax.numpy.stack(keys)


def _is_seed(x):
    return x is None or integer(x) is not None


def _positive(name, x):
    if (integer(x) or 0) < 1:
        raise ValueError(f"{name} is {x!r}; it must be a positive integer")
    return integer(x)


def _mode(mode):
    try:
        return AutoresetMode(mode)
    except ValueError:
        allowed = ", ".join(repr(x.value) for x in AutoresetMode)
        raise ValueError(f"autoreset_mode is {mode!r}; it must be {allowed}") from None


def _same_step_info(ended, final_observations, after_step):
    """Gymnasium's info of a step: values beside masks that say whose they are.

    As in Gymnasium's own vectors, an ended episode's are in ``final_info`` alone.
    """
    info = _masked(after_step, ~ended)
    if ended.any():
        final_obs = np.full(len(ended), None, object)
        for i in np.flatnonzero(ended):
            final_obs[i] = final_observations[i]
        final_info = _masked(after_step, ended)
        info |= {"final_obs": final_obs, "_final_obs": ended.copy()}
        info |= {"final_info": final_info, "_final_info": ended.copy()}
    return info


def _masked(values, mask):
    values = {name: np.where(mask, x, x.dtype.type(0)) for name, x in values.items()}
    return values | {f"_{name}": mask.copy() for name in values}
