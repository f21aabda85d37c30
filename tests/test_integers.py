"""Integers are integers, whoever made them."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import attjax
from attjax import AttitudeEnv, evaluation
from attjax.config import presets
from attjax.config import run as run_config
from attjax.control import classical
from attjax.spacecraft import LM50

pytestmark = pytest.mark.usefixtures("strict_promotion")


@pytest.mark.parametrize("integer", [np.int64, np.uint8, np.array, jnp.int32])
def test_integers_are_integers_whoever_made_them(integer):
    env = AttitudeEnv(frameskip=integer(20))
    assert env == AttitudeEnv(20) and hash(env) == hash(AttitudeEnv(20))
    assert LM50.max_steps(integer(20)) == 500
    params, key = env.default_params, jax.random.key(0)
    state = env.reset(key, params)[1]
    assert attjax.step(state, integer(1), params, integer(20)).time == 1
    given = evaluation.conditions(env, params, integer(3), integer(4))
    assert json.loads(json.dumps(given))["seed"] == 3
    config = run_config.Config("paper", integer(3), presets.PAPER)
    assert type(config.seed) is int


def test_evaluation_flies_numpys_numbers_of_episodes():
    env = AttitudeEnv(20)
    params = env.default_params.replace(max_steps_in_episode=jnp.int32(3))
    controller = jax.tree_util.Partial(classical.phase_plane)
    flown = evaluation.fly(controller, env, params, jax.random.key(0), np.int64(2))
    assert flown.score.shape == (2,)
    with pytest.raises(ValueError, match=r"episodes is 2\.5; it must be an integer at least 1"):
        evaluation.fly(controller, env, params, jax.random.key(0), 2.5)


@pytest.mark.parametrize("frameskip", [-1, 10_500, 2.5, "5", True, np.True_, np.float64(5)])
def test_bad_frameskips_are_refused(frameskip):
    with pytest.raises(ValueError, match=r"frameskip is .* from 0 to 10499"):
        AttitudeEnv(frameskip=frameskip)
