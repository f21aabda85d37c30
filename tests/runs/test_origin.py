"""A run that begins with the networks of another, on another spacecraft: ``--resume-from``."""

import shutil

import jax
import numpy as np
import pytest
from setups import SETTINGS

import attjax
from attjax.config import run as run_config
from attjax.errors import UserError
from attjax.runs import checkpoint, origin
from attjax.runs import folder as run_folder
from attjax.runs import run as run_module
from attjax.runs.folder import FolderError
from attjax.runs.keeper import Place
from attjax.runs.run import Run
from attjax.runs.trainer import Observer
from attjax.spacecraft import LM50, Spacecraft

HEAVIER = Spacecraft(name="heavier", inertia=(1.744, 0.23, 1.594))
SMALL = SETTINGS.replace(updates_per_block=1)
UPDATE = SMALL.ppo.steps_per_update


@pytest.fixture(scope="module", autouse=True)
def _one_program():
    """The same program for all runs of a setup; to compile it takes longer than all else."""
    programs, compiled = {}, Run.compiled
    with pytest.MonkeyPatch.context() as patch:

        def of_setup(run, debug_nans=False):
            if run.setup not in programs:
                programs[run.setup] = compiled(run)
            return programs[run.setup]

        patch.setattr(Run, "compiled", of_setup)
        yield


class Killed(Exception):
    """Nothing is done any more."""


class Killer(Observer):
    """Ends a process, as it were, at its start or after a block; nothing is saved on the way."""

    def __init__(self, before=0):
        self._before = before

    def started(self, run, _):
        self.params = jax.tree.map(np.array, run.learner.params)
        self.adam = jax.tree.map(np.array, run.learner.optimizer)
        if self._before == 0:
            raise Killed

    def block(self, row):
        if row["agent_steps"] >= UPDATE * self._before:
            raise Killed


@pytest.fixture(scope="module")
def old(tmp_path_factory):
    """The folder of a run of two updates, and the run."""
    folder = tmp_path_factory.mktemp("old")
    return folder, attjax.train(SMALL, seed=4, folder=folder, total_steps=2 * UPDATE)


@pytest.fixture(scope="module")
def calm(old):
    """The same run on, with nobody to kill it and no folder."""
    return on(old)


@pytest.fixture
def moved(old, tmp_path):
    """A copy of the folder that a test may spoil."""
    return shutil.copytree(old[0], tmp_path / "old")


def on(old, folder=None, callback=None, **values):
    """A run that begins from the old one's folder."""
    values = {"resume_from": old[0], "spacecraft": HEAVIER, "total_steps": 3 * UPDATE} | values
    return attjax.train(folder=folder, callback=callback, **values)


def assert_same(a, b):
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(*map(jax.tree.leaves, (a, b))):
        if jax.dtypes.issubdtype(x.dtype, jax.dtypes.prng_key):
            x, y = map(jax.random.key_data, (x, y))
        np.testing.assert_array_equal(x, y)


def killed(folder, old, before=0, **values):
    killer = Killer(before)
    with pytest.raises(Killed):
        on(old, Place(folder=folder, save_every=1e9), killer, **values)
    return killer


def test_it_begins_with_the_others_networks_to_the_bit(old, tmp_path):
    folder, run = old
    seen = killed(tmp_path / "new", old, before=1)
    assert_same(seen.params, run.learner.params)
    assert not any(np.any(x) for x in jax.tree.leaves(seen.adam))
    assert checkpoint.latest(tmp_path / "new") == 0
    assert_same(checkpoint.restore_policy(tmp_path / "new").args[0], run.policy.args[0])
    read = run_folder.read_config(tmp_path / "new").resumed_from
    assert read == run_config.Origin(str(folder.resolve()), run_folder.run_id(folder), 2, True)


def test_all_that_is_not_given_is_as_it_was(old):
    folder, run = old
    same = origin.new({"resume_from": folder})
    assert same.settings == run.config.settings and same.preset == run.config.preset
    assert (same.spacecraft, same.world.name, same.seed) == (LM50, "ideal", 0)
    given = {"spacecraft": HEAVIER, "world": "stress", "clip": 0.1, "seed": 5}
    changed = origin.new({"resume_from": folder, **given})
    assert changed.settings == run.config.settings.replace(clip=0.1)
    assert (changed.spacecraft, changed.world.name, changed.seed) == (HEAVIER, "stress", 5)
    preset = {"preset": "precise", "hidden_sizes": (8,)}
    recipe = origin.new({"resume_from": folder, **preset})
    assert recipe.settings == run_config.new(**preset).settings
    assert recipe.preset == "precise"


@pytest.mark.parametrize("before", [0, 1, 2])
def test_killed_it_goes_on_to_the_same_bits(old, moved, calm, tmp_path, before):
    """Before its first checkpoint it begins again; after that it needs the other folder no more."""
    new = tmp_path / "new"
    killed(new, (moved,), before)
    assert checkpoint.latest(new) == (None if before == 0 else 0)
    if before:
        shutil.rmtree(moved)
    resumed = attjax.train(folder=Place(folder=new, resume=True))
    assert_same(resumed.learner, calm.learner)


def test_what_is_gone_before_the_first_checkpoint_is_named(moved, tmp_path):
    new = tmp_path / "new"
    killed(new, (moved,))
    shutil.rmtree(moved / "2")
    again = Place(folder=new, resume=True)
    with pytest.raises(FolderError, match=r"networks of another: .*old holds no checkpoint 2"):
        attjax.train(folder=again)
    attjax.train(SMALL, folder=Place(folder=moved, overwrite=True), total_steps=2 * UPDATE)
    with pytest.raises(FolderError, match="old holds another run now"):
        attjax.train(folder=again)
    shutil.rmtree(moved)
    with pytest.raises(FolderError, match=r"there is no checkpoint folder .*old"):
        attjax.train(folder=again)


def test_resume_starts_it_or_goes_on_with_it(old, calm, tmp_path):
    place = Place(folder=tmp_path / "new", resume=True)
    assert_same(on(old, place).learner, calm.learner)
    assert on(old, place).update == 3  # and nothing is left to do
    with pytest.raises(UserError, match=r"leave out resume_from \(.*old"):
        on((tmp_path,), place)


def test_resume_refuses_a_run_that_began_anew(old, moved):
    with pytest.raises(UserError, match=r"leave out resume_from \(None\)"):
        attjax.train(folder=Place(folder=moved, resume=True), resume_from=old[0])


def test_a_policy_without_value_network_is_continued_with_a_new_one(old, moved, tmp_path):
    shutil.rmtree(moved / "2" / "learner")
    seen = killed(tmp_path / "new", (moved,))
    assert_same(seen.params["policy"], old[1].learner.params["policy"])
    anew = Killer()
    with pytest.raises(Killed):
        on(old, None, anew, resume_from=None, preset=SMALL)
    assert_same(seen.params["value"], anew.params["value"])
    assert not run_folder.read_config(tmp_path / "new").resumed_from.has_value


def test_the_policy_waits_for_a_new_value_network(old, moved, tmp_path, monkeypatch):
    """Two updates here, whatever a block has, and whoever is killed within them."""
    monkeypatch.setattr(run_module, "HELD", 2)
    shutil.rmtree(moved / "2" / "learner")
    policies, values, given = [], [], {"total_steps": 4 * UPDATE, "updates_per_block": 3}

    class Seen(Observer):
        def started(self, run, _):
            self._run = run
            self.block({})

        def block(self, row):
            policies.append(jax.tree.map(np.array, self._run.learner.params["policy"]))
            values.append(jax.tree.map(np.array, self._run.learner.params["value"]))

    whole = on((moved,), None, Seen(), **given)
    assert [int(row["agent_steps"]) for row in whole.rows] == [n * UPDATE for n in (1, 2, 4)]
    for held in policies[:3]:
        assert_same(held, old[1].learner.params["policy"])
    assert not any(map(is_same, jax.tree.leaves(policies[2]), jax.tree.leaves(policies[3])))
    assert not any(map(is_same, jax.tree.leaves(values[0]), jax.tree.leaves(values[1])))
    place = Place(folder=tmp_path / "new", save_every=0)
    with pytest.raises(Killed):
        on((moved,), place, Killer(1), **given)
    assert checkpoint.latest(place.folder) == 1
    resumed = attjax.train(folder=Place(folder=place.folder, resume=True))
    assert_same(resumed.learner, whole.learner)


def is_same(a, b):
    return np.array_equal(a, b)


def test_it_can_take_the_place_of_a_run(old, moved, tmp_path):
    """But for one whose networks cannot be read: then all is as it was."""
    before = run_folder.run_id(moved)
    spoiled = shutil.copytree(old[0], tmp_path / "spoiled")
    shutil.rmtree(spoiled / "2" / "policy" / "d")
    place = Place(folder=moved, overwrite=True)
    with pytest.raises(FolderError, match=r"networks of another: checkpoint .* cannot be read"):
        on((spoiled,), place)
    assert (run_folder.run_id(moved), checkpoint.latest(moved)) == (before, 2)
    assert on(old, place).update == 3 and checkpoint.latest(moved) == 3
