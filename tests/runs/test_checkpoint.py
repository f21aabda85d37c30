import dataclasses
import shutil

import jax
import numpy as np
import pytest
from setups import CONFIG, SETTINGS

from attjax import AttitudeEnv, ppo
from attjax.ppo import train_state
from attjax.runs import build, checkpoint, earlier
from attjax.runs import folder as run_folder
from attjax.runs.folder import FolderError


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A run folder with one checkpoint, and the learner saved in it."""
    folder = tmp_path_factory.mktemp("run")
    run_folder.create(folder, CONFIG, overwrite=False)
    setup = build.setup(SETTINGS)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(3))
    state, _ = ppo.train_block(setup, env_params, state, 2)
    with checkpoint.Saver(folder) as saver:
        saver.save(state)
        saver.save(state)  # the same update again: left as it is
    return folder, setup, env_params, state


def copy(learner_state):
    """The block donates its argument."""
    return jax.tree.map(lambda x: x.copy(), learner_state)


def test_restored_learner_is_the_saved_one_and_goes_on_bitwise(trained):
    folder, setup, env_params, state = trained
    assert checkpoint.latest(folder) == 2
    template = train_state.init(setup, env_params, jax.random.key(99))
    restored = checkpoint.restore_learner(folder, template)
    on_from_memory, _ = ppo.train_block(setup, env_params, copy(state), 2)
    on_from_disk, _ = ppo.train_block(setup, env_params, restored, 2)
    assert on_from_disk.update == 4
    for a, b in zip(jax.tree.leaves(on_from_memory), jax.tree.leaves(on_from_disk)):
        if jax.dtypes.issubdtype(a.dtype, jax.dtypes.prng_key):
            a, b = map(jax.random.key_data, (a, b))
        np.testing.assert_array_equal(a, b)


def test_a_learner_of_an_earlier_version_goes_on(trained, tmp_path):
    """One vector a network were Adam's moments then."""
    _, setup, env_params, state = trained
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    old = earlier.flat(state)
    biases = state.params["value"]["params"]["Dense_0"]["bias"].size
    moments = state.optimizer["value"][1][0].mu["params"]["Dense_0"]
    first = np.asarray(old.optimizer["value"][1][0].mu)
    np.testing.assert_array_equal(first[:biases], moments["bias"])
    kernel = first[biases : biases + moments["kernel"].size]
    np.testing.assert_array_equal(kernel, moments["kernel"].ravel())
    with checkpoint.Saver(tmp_path) as saver:
        saver.save(old)
    template = train_state.init(setup, env_params, jax.random.key(99))
    restored = checkpoint.restore_learner(tmp_path, template)
    assert restored.update == 2
    jax.tree.map(np.testing.assert_array_equal, restored.params, state.params)
    jax.tree.map(np.testing.assert_array_equal, restored.optimizer, state.optimizer)


def test_a_run_goes_on_with_another_number_of_devices(trained):
    folder, setup, env_params, state = trained
    setup = dataclasses.replace(setup, num_devices=2)
    env_params = build.env_params(setup)
    template = train_state.init(setup, env_params, jax.random.key(99))
    restored = checkpoint.restore_learner(folder, template)
    jax.tree.map(np.testing.assert_array_equal, restored.params, state.params)
    later, metrics = ppo.train_block(setup, env_params, restored, 2)
    assert later.update == 4
    assert {int(update) for update in metrics["diverged"].values()} == {-1}


def observe_some(env, n=50):
    keys = jax.random.split(jax.random.key(0), n)
    return jax.vmap(env.reset, (0, None))(keys, env.default_params)[0]


def test_restored_policy_acts_as_the_saved_one(trained):
    folder, setup, _, state = trained
    act = checkpoint.restore_policy(folder)
    env = AttitudeEnv(20)
    context = env.context(env.default_params)
    for observation in observe_some(env):
        assert act(observation, context) == setup.policy.act(state.params, observation, context)


def test_float32_policy_serves_a_float64_simulation(trained, x64):
    act = checkpoint.restore_policy(trained[0])
    env = AttitudeEnv(20)
    observation = observe_some(env, 1)[0]
    assert observation.dtype == np.float64
    assert 0 <= int(act(observation, env.context(env.default_params))) < 19


def test_missing_empty_and_truncated_folders_are_refused(tmp_path, trained):
    with pytest.raises(FolderError, match="no checkpoint folder"):
        checkpoint.restore_policy(tmp_path / "nowhere")
    with pytest.raises(FolderError, match=r"no config\.json"):
        checkpoint.restore_policy(tmp_path)
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    with pytest.raises(FolderError, match="no checkpoint yet"):
        checkpoint.restore_policy(tmp_path)
    (tmp_path / "config.json").write_text("{")
    with pytest.raises(FolderError, match="cannot be read"):
        checkpoint.restore_policy(tmp_path)


def saved_errors(folder, state, errors):
    with checkpoint.Saver(folder) as saver:
        for update, error in enumerate(errors, 1):
            saver.save(state.replace(update=np.int32(update)), error)


def test_the_newest_three_and_the_best_are_kept(trained, tmp_path):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    errors = [9.0, 0.5, None, 7.0, 0.6, 5.0, 4.0]
    saved_errors(tmp_path, trained[3], errors[:4])
    saved_errors(tmp_path, trained[3], errors)  # as a resumed run does: it knows them again
    assert sorted(int(p.name) for p in tmp_path.iterdir() if p.is_dir()) == [2, 5, 6, 7]
    assert (checkpoint.latest(tmp_path), checkpoint.best(tmp_path)) == (7, 2)
    jax.tree.map(
        np.testing.assert_array_equal,
        checkpoint.restore_policy(tmp_path, checkpoint.best(tmp_path)).args[0]["policy"],
        trained[3].params["policy"],
    )


def test_other_networks_are_refused_in_one_line(trained, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(trained[0], folder)
    for sizes in ((16,), (8, 8)):
        settings = SETTINGS.replace(hidden_sizes=sizes)
        run_folder.write_config(folder, dataclasses.replace(CONFIG, settings=settings))
        with pytest.raises(FolderError, match="cannot be read") as error:
            checkpoint.restore_policy(folder)
        assert "\n" not in str(error.value)


def test_half_written_checkpoints_are_cleared_away(trained, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(trained[0], folder)
    for leftover in (".attjax-saving/checkpoint", ".attjax-removed/1"):
        shutil.copytree(folder / "2", folder / leftover)
    assert checkpoint.latest(folder) == 2
    with run_folder.opened(folder):
        assert sorted(p.name for p in folder.iterdir()) == [".attjax-lock", "2", "config.json"]


def test_a_checkpoint_that_cannot_be_written_leaves_those_before(trained, tmp_path, monkeypatch):
    folder = tmp_path / "run"
    shutil.copytree(trained[0], folder)

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    with checkpoint.Saver(folder) as saver:
        monkeypatch.setattr(saver._orbax, "save", full)
        with pytest.raises(FolderError, match="No space left on device"):
            saver.save(trained[3].replace(update=np.int32(9)))
    assert checkpoint.latest(folder) == 2


def test_damaged_checkpoints_are_refused_in_one_line(trained, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(trained[0], folder)
    for path in (folder / "2" / "policy").rglob("*"):
        if path.is_file():
            path.write_bytes(b"")
    with pytest.raises(FolderError, match="cannot be read") as error:
        checkpoint.restore_policy(folder)
    assert "\n" not in str(error.value)
