"""Probe environments: tiny MDPs whose values and best actions are known.

A learner that gets one of them wrong has a named fault: see each test in test_train.py.
"""

import dataclasses

import chex
import jax
import jax.numpy as jnp
from flax import struct


@struct.dataclass
class ProbeState:
    observation: chex.Array
    time: chex.Array


@struct.dataclass
class ProbeParams:
    max_steps_in_episode: chex.Array


@dataclasses.dataclass(frozen=True)
class Probe:
    """An episode of ``length`` steps, ended by the time limit or by termination.

    The observation is (sign, step / length), or (sign, 0) where time is not shown.
    ``reward`` is one of:
    "constant", 1 each step; "sign", the observed sign; "last", 1 at the last step;
    "match", 1 where action 1 meets sign +1 or action 0 meets sign −1, else 0;
    "aim", minus the squared distance of a (3,) action from (sign / 2, 0, 0).
    """

    reward: str
    length: int = 1
    truncates: bool = False
    shows_time: bool = True

    @property
    def default_params(self):
        return ProbeParams(jnp.array(self.length, jnp.int32))

    def context(self, params):
        return None

    def reset(self, key, params):
        sign = jnp.where(jax.random.bernoulli(key), 1.0, -1.0)
        state = ProbeState(jnp.stack([sign, 0.0]), jnp.zeros((), jnp.int32))
        return state.observation, state

    def starts_whole(self, state):
        return state.time == 0

    def step_env(self, key, state, action, params):
        time = state.time + 1
        sign = state.observation[0]
        final = jnp.stack([sign, time / self.length * self.shows_time])
        at_end = time >= params.max_steps_in_episode
        reward = {
            "constant": lambda: jnp.ones(()),
            "sign": lambda: sign,
            "last": lambda: jnp.where(at_end, 1.0, 0.0),
            "match": lambda: jnp.where((action == 1) == (sign > 0), 1.0, 0.0),
            "aim": lambda: -jnp.sum((action - jnp.stack([sign / 2, 0.0, 0.0])) ** 2),
        }[self.reward]()
        never = jnp.zeros((), bool)
        terminated, truncated = (never, at_end) if self.truncates else (at_end, never)
        info = {"truncated": truncated, "score": reward, "outcome": {}}
        return final, ProbeState(final, time), reward, terminated, info
