"""What benchmarks/td3.py learns from: rejax's TD3, told which episodes the time limit only cut."""

import importlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from commands import ROOT

pytest.importorskip("rejax")

from attjax import AttitudeEnv
from attjax.envs import observation as observations

ENV = AttitudeEnv(20, actions="continuous")
REST = jnp.zeros(3)
KEY = jax.random.key(0)


@pytest.fixture
def learners(monkeypatch):
    """benchmarks/td3_learner.py."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("td3_learner")


@pytest.mark.parametrize("terminates", [False, True])
def test_the_time_limit_is_an_end_only_where_asked(learners, terminates):
    task = learners.Task(ENV, 1.0, terminates)
    params = ENV.default_params.replace(max_steps_in_episode=2)
    observation, led = task.reset(KEY, params)
    np.testing.assert_array_equal(led.observation, observation)
    told = []
    for _ in range(2):
        observation, led, _, done, _ = task.step(jax.random.key(1), led, REST, params)
        told.append((bool(done), bool(led.ended)))
    assert told == [(False, False), (True, terminates)]
    assert not np.allclose(led.observation, observation)  # the old episode's, and the new one's
    np.testing.assert_array_equal(led.observation[observations.ANGULAR_VELOCITY], REST)
    assert led.state.time == 0


def test_overspeed_is_an_end(learners):
    task, params = learners.Task(ENV, 1.0, False), ENV.default_params
    _, led = task.reset(KEY, params)
    fast = led.state.replace(angular_velocity=jnp.array([0.6, 0.0, 0.0]))
    _, led, _, done, _ = task.step(KEY, led.replace(state=fast), REST, params)
    assert done and led.ended and led.observation[observations.ANGULAR_VELOCITY][0] > 0.5


def test_the_buffer_holds_what_steps_led_to(learners):
    """Of random torques, before the first gradient step: each row's next observation is the next
    row's observation but where an episode is over, and done only where that was at overspeed."""
    with jax.legacy_prng_key("allow"):  # rejax's
        learner = learners.Learner(learners.Task(ENV, 1.0, False), seed=0)
        learner.advance(learners.NUM_ENVS * 510)
    rows = jax.tree.map(
        lambda x: np.asarray(x[: learner.agent_steps]).reshape(510, learners.NUM_ENVS, -1),
        learner.state.replay_buffer.data,
    )
    is_over = np.any(rows.next_obs[:-1] != rows.obs[1:], axis=-1)
    rate = np.linalg.norm(rows.next_obs[..., observations.ANGULAR_VELOCITY], axis=-1)
    is_fast = rate > ENV.default_params.rate_limit
    np.testing.assert_array_equal(rows.done[..., 0], is_fast)
    cut = is_over & ~is_fast[:-1]
    assert np.all(is_over[is_fast[:-1]]) and cut.sum() >= 1
    assert set(np.nonzero(cut)[0].tolist()) <= {499}
