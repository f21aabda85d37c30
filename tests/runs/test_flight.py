"""Flight loops of saved policies: one alone, or with another for when an axis is dead."""

import dataclasses
import itertools
import shutil
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv, load_flight_loop
from attjax.envs import observation as observations
from attjax.ppo.crew import Crew
from attjax.runs import flight
from attjax.runs.folder import FolderError

PRETRAINED = Path(__file__).parents[2] / "pretrained"
UNIVERSAL = PRETRAINED / "universal"


def contexts():
    """Of LM50, whole and with each axis's torques dead or all but dead."""
    env = AttitudeEnv(5)
    whole = env.context(env.default_params)
    for gains in np.vstack([np.ones((3, 3)) - np.eye(3), 1 - 0.99 * np.eye(3)]):
        table = whole.torque_table * jnp.asarray(gains, whole.torque_table.dtype)
        yield False, whole
        yield True, dataclasses.replace(whole, torque_table=table)


class Saying:
    """A policy whose answers are a number each, by which it is known."""

    def __init__(self, number):
        self.number = number

    def act(self, params, observation, context):
        """An action."""
        return jnp.asarray([self.number, 0]) + params

    def draw(self, params, key, observation, context):
        """Another."""
        return jnp.asarray([self.number, 1]) + params

    def scores(self, params, observation, context):
        """What is for the actions."""
        return jnp.asarray([self.number, 2]) + params


def test_the_policy_is_chosen_that_is_for_what_is_left():
    """Whichever way it is asked: for an action, for one drawn, for scores."""
    crew, params = Crew(Saying(1), Saying(2)), {"whole": 10, "crippled": 20}
    for is_crippled, context in contexts():
        number, added = (2, 20) if is_crippled else (1, 10)
        asked = (
            crew.act(params, None, context),
            crew.draw(params, None, None, context),
            crew.scores(params, None, context),
        )
        for way, found in enumerate(asked):
            assert found.tolist() == [number + added, way + added]


def test_a_universal_agent_flies_with_the_one_for_two_torques():
    """Each of them decides as it does alone."""
    crew, params = flight.network(UNIVERSAL, adapts=True)
    assert isinstance(crew, Crew) and crew.is_universal
    told = observations.observe(jnp.asarray([0.6, 0.0, 0.48, 0.64]), jnp.asarray([0.02, 0.0, 0.01]))
    (_, whole), (_, crippled) = itertools.islice(contexts(), 2)
    for context, name in ((whole, "whole"), (crippled, "crippled")):
        alone = jax.jit(getattr(crew, name).scores)(params[name], told, context)
        np.testing.assert_allclose(
            jax.jit(crew.scores)(params, told, context), alone, rtol=1e-5, atol=1e-5
        )


def test_a_loop_that_does_not_adapt_has_one_policy():
    """It would never learn that an axis is dead."""
    policy, _ = flight.network(UNIVERSAL)
    assert not isinstance(policy, Crew)
    assert not load_flight_loop(UNIVERSAL).adapts
    assert load_flight_loop(UNIVERSAL, adapts=True).adapts
    precise, _ = flight.network(PRETRAINED / "precise", adapts=True)
    assert not isinstance(precise, Crew)


def test_the_other_policy_must_be_a_universal_one(tmp_path):
    folder = tmp_path / "universal"
    shutil.copytree(UNIVERSAL, folder, ignore=shutil.ignore_patterns(flight.TWO_TORQUES))
    assert not isinstance(flight.network(folder, adapts=True)[0], Crew)
    shutil.copytree(PRETRAINED / "precise", folder / flight.TWO_TORQUES)
    with pytest.raises(FolderError, match="two-torques holds a policy of one spacecraft"):
        flight.network(folder, adapts=True)
