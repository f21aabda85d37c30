"""Flight loops of saved policies: one alone, or with another for when an axis is dead."""

import dataclasses
import functools
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


@functools.partial(jax.jit, static_argnums=0)
def asked(crew, params, told, context):
    """Action, one drawn, and scores: the crew's, those of its policy for all axes and for two."""
    key = jax.random.key(0)
    members = (crew, params), *((getattr(crew, x), params[x]) for x in ("whole", "crippled"))
    return [
        (
            x.act(of_it, told, context),
            x.draw(of_it, key, told, context),
            x.scores(of_it, told, context),
        )
        for x, of_it in members
    ]


def test_the_policy_is_chosen_that_is_for_what_is_left():
    """Whichever way it is asked: for an action, for one drawn, for scores."""
    crew, params = flight.network(UNIVERSAL, adapts=True)
    assert isinstance(crew, Crew) and crew.is_universal
    rng, differing = np.random.default_rng(0), 0
    for is_crippled, context in contexts():
        for _ in range(4):
            q = rng.normal(size=4)
            told = observations.observe(
                jnp.asarray(q / np.linalg.norm(q), jnp.float32),
                jnp.asarray(rng.normal(0, 0.05, 3), jnp.float32),
            )
            found, whole, crippled = asked(crew, params, told, context)
            chosen, other = (crippled, whole) if is_crippled else (whole, crippled)
            for ours, theirs in zip(found, chosen):
                np.testing.assert_array_equal(ours, theirs)
            differing += int(other[0] != found[0])
    assert differing > 10


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
