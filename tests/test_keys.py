"""Whatever an environment may draw from its keys, no two draws are of the same key."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv, EnvState, evaluation

COAST = jax.tree_util.Partial(lambda observation, context: jnp.array(0))
EPISODES, STEPS = 3, 4
BLOCKS = 16
"""A start is drawn from so many blocks of its key, as ``uniform`` and ``split`` are, and more."""


def note(seen, key):
    jax.debug.callback(lambda data: seen.append(tuple(data.tolist())), jax.random.key_data(key))


@dataclasses.dataclass(frozen=True, eq=False)
class Noisy(AttitudeEnv):
    """Notes all that its starts and its observations are drawn from."""

    starts: list = dataclasses.field(default_factory=list)
    observations: list = dataclasses.field(default_factory=list)
    steps: list = dataclasses.field(default_factory=list)

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "initial_state", self._start)

    def _start(self, key, params):
        note(self.starts, key)
        for block in jax.random.split(key, BLOCKS):
            note(self.starts, block)
        at_rest = jnp.zeros(3), jnp.zeros((), jnp.int32)
        return EnvState(jnp.array([0.0, 0.0, 0.6, 0.8]), *at_rest)

    def observe(self, key, state, params):
        note(self.observations, key)
        return super().observe(key, state, params)

    def step_env(self, key, *args):
        note(self.steps, key)
        return super().step_env(key, *args)

    def counts(self, *, episodes, steps):
        """Check that there were so many, and that no key served twice."""
        jax.effects_barrier()
        assert len(self.starts) == (1 + BLOCKS) * episodes
        assert len(self.observations) == episodes + steps and len(self.steps) == steps
        assert set(self.steps) <= set(self.observations)  # of the state after the step
        keys = self.starts + self.observations
        assert len(set(keys)) == len(keys)


def short(env):
    return env.default_params.replace(max_steps_in_episode=jnp.array(STEPS, jnp.int32))


def test_a_step_and_the_reset_after_it_have_their_own_keys():
    env = Noisy(1)
    jax.jit(env.step)(jax.random.key(5), env._start(jax.random.key(6), None), 0, short(env))
    jax.effects_barrier()
    del env.starts[: 1 + BLOCKS]
    env.counts(episodes=1, steps=1)


def test_each_step_of_each_episode_of_an_evaluation_has_its_own_key():
    env = Noisy(1)
    evaluation.fly(COAST, env, short(env), jax.random.key(5), EPISODES)
    env.counts(episodes=EPISODES, steps=EPISODES * STEPS)


def test_recorded_slews_have_the_keys_of_the_flown_ones():
    env = Noisy(1)
    key, params = jax.random.key(5), short(env)
    evaluation.fly(COAST, env, params, key, EPISODES)
    jax.effects_barrier()
    flown = sorted(env.observations)
    env.observations.clear()
    start = jax.tree.map(lambda x: jnp.stack([x] * EPISODES), env._start(key, None))
    evaluation.record(COAST, env, params, key, start, STEPS)
    jax.effects_barrier()
    assert sorted(env.observations) == flown


@pytest.mark.parametrize("mode", ["one", "SameStep", "NextStep"])
def test_each_step_under_gymnasium_has_its_own_key(mode):
    pytest.importorskip("gymnasium")
    from attjax.wrappers import gymnasium

    env = Noisy(1)
    params = short(env)
    if mode == "one":
        gym, action = gymnasium.SlewEnv(env=env, params=params), 0
    else:
        gym = gymnasium.SlewVectorEnv(2, env=env, params=params, autoreset_mode=mode)
        action = np.zeros(2, int)
    jax.effects_barrier()
    for seen in (env.starts, env.observations, env.steps):
        seen.clear()  # of a reset that checks the parameters
    for _ in range(2):
        gym.reset()
        for _ in range(STEPS - 1):
            gym.step(action)
    each = len(np.atleast_1d(action))
    env.counts(episodes=2 * each, steps=2 * each * (STEPS - 1))
