"""A controller and the slews that figures show of it."""

import dataclasses
import functools
from typing import NamedTuple

import chex
import jax
import jax.numpy as jnp
import numpy as np

from attjax import evaluation
from attjax.dynamics import quaternion as quaternions
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.parameters import EnvParams, EnvState
from attjax.evaluation import paper
from attjax.evaluation.episodes import Episodes
from attjax.evaluation.flown import Controller
from attjax.evaluation.history import History, estimation_errors
from attjax.evaluation.paper import is_the_papers


def angles_deg(quaternion: chex.Array) -> np.ndarray:
    """(...,) error angles of quaternions (..., 4), degrees."""
    flat = quaternion.reshape(-1, 4)
    angles = jnp.rad2deg(jax.vmap(quaternions.error_angle)(flat))
    return np.asarray(angles).reshape(quaternion.shape[:-1])


class Belief(NamedTuple):
    """What was believed in some slews, at each decision.

    Attributes:
        time: (steps,) of the decisions, s: a control period before that of the history's samples.
        angle_deg: (steps, slews) error angle of the believed attitude, degrees.
        error_deg: (steps, slews) angle between the believed and the true attitude, degrees.
    """

    time: np.ndarray
    angle_deg: np.ndarray
    error_deg: np.ndarray


def truth_is_told(env: AttitudeEnv, params: EnvParams) -> bool:
    """Whether the attitude that is believed is the true one; there is no estimate to show then."""
    return env.context(params).knowledge.attitude is None


@dataclasses.dataclass(frozen=True)
class Flight:
    """A controller, and the slews that it flies: those of :func:`attjax.evaluate`."""

    controller: Controller
    env: AttitudeEnv
    params: EnvParams
    seed: int
    episodes: int

    @property
    def conditions(self) -> str:
        """The control rate, and the world unless it is the ideal one, for titles."""
        hz = f"{1 / self.env.control_period:.2f} Hz"
        return hz if self.env.world.is_ideal else f"{hz}, world {self.env.world.name}"

    @property
    def is_the_papers(self) -> bool:
        """Whether the paper's results can stand beside this flight's."""
        return is_the_papers(self.env.spacecraft, self.env.world.name)

    @property
    def goal_deg(self) -> float:
        """The largest error angle that counts as pointing, degrees."""
        return self.env.spacecraft.goal_angle_deg

    @property
    def starts(self) -> EnvState:
        """The initial states of the flown slews."""
        key = jax.random.key(self.seed)
        return evaluation.random_slews(self.env, self.params, key, self.episodes)[1]

    @functools.cached_property
    def flown(self) -> Episodes:
        """The outcome of its episodes."""
        key = jax.random.key(self.seed)
        return evaluation.fly(self.controller, self.env, self.params, key, self.episodes)

    @functools.cached_property
    def table_5(self) -> tuple[np.ndarray, History]:
        """Time and history of Table 5's slews, which two figures show."""
        return self.record(paper.table_5_slews())

    def record(self, start: EnvState) -> tuple[np.ndarray, History]:
        """Time in s, (steps,), and the history of slews from the given states."""
        steps = int(self.params.max_steps_in_episode)
        key = jax.random.key(self.seed)
        history = evaluation.record(self.controller, self.env, self.params, key, start, steps)
        return np.arange(1, steps + 1) * self.env.control_period, history

    def belief(self, start: EnvState, history: History) -> Belief | None:
        """What was believed in slews from the given states; None where the truth is told."""
        if truth_is_told(self.env, self.params):
            return None
        return Belief(
            np.arange(len(history.believed)) * self.env.control_period,
            angles_deg(history.believed),
            np.rad2deg(estimation_errors(start, history)),
        )
