"""Paths are taken as they are, whatever characters are in them."""

import os
import shutil

import jax
import numpy as np
import pytest
from commands import TINY, eval_script, export_script, train_script
from setups import CONFIG, SETTINGS

from attjax.export import c as export_c
from attjax.ppo import train_state
from attjax.runs import build, checkpoint
from attjax.runs import folder as run_folder
from attjax.runs.folder import FolderError

NAMES = [
    "run[1]", "[!a]*?", "{x}{}", "sp ace", "ünï", "line\nbreak\n", "%41#", "back\\slash", "~",
    "a:b", "$HOME", "'\"", os.fsdecode(b"\xff"),
]  # fmt: skip


@pytest.fixture(scope="module")
def state():
    setup = build.setup(SETTINGS)
    return train_state.init(setup, build.env_params(setup), jax.random.key(3))


@pytest.mark.parametrize("name", NAMES, ids=map(ascii, NAMES))
def test_a_run_may_be_anywhere(tmp_path, state, name):
    for folder in (tmp_path / name, tmp_path / "under" / name / "run"):
        with run_folder.opened(folder):
            run_folder.create(folder, CONFIG, overwrite=False)
            with checkpoint.Saver(folder) as saver:
                for update in range(5):
                    saver.save(state.replace(update=np.int32(update)), 9.0 - update)
        assert sorted(os.listdir(folder)) == ["2", "3", "4", "config.json"]
        assert checkpoint.best(folder) == checkpoint.latest(folder) == 4
        act = checkpoint.restore_policy(folder)
        jax.tree.map(np.testing.assert_array_equal, act.args[0]["policy"], state.params["policy"])


def test_all_programs_take_them(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    name = "run[1] {}"
    folder = tmp_path / name
    assert train_script.main([*TINY, "--total-steps", "1", "--checkpoint", str(folder)]) == 0
    advice = capsys.readouterr().out.splitlines()[-1]
    assert advice.endswith(f"--checkpoint '{folder}'")
    common = ["--device", "cpu", "--checkpoint", str(folder)]
    few = ["--episodes", "2", "--duration", "2"]
    json, plots, page, out = (tmp_path / kind / name for kind in ("j", "f", "h", "o"))
    for path in (json, page):
        path.parent.mkdir()
    files = ["--json", str(json), "--plot", str(plots), "--playback", str(page)]
    assert eval_script.main([*common, *few, *files]) == 0
    assert json.stat().st_size and page.stat().st_size and list(plots.iterdir())
    assert export_script.main([*common, "--format", "c", "--out", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == set(export_c.FILES)


@pytest.mark.parametrize("item", ["policy", "learner"])
def test_a_checkpoint_that_does_not_read_back_is_not_taken_for_saved(
    tmp_path, state, monkeypatch, item
):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    whole = checkpoint.ocp.Checkpointer.save

    def torn(self, path, *arguments, **options):
        whole(self, path, *arguments, **options)
        for file in (path / item / "d").iterdir():
            file.write_bytes(file.read_bytes()[:-1])
        shutil.rmtree(path / item / "ocdbt.process_0")

    with checkpoint.Saver(tmp_path) as saver:
        for update in range(3):
            saver.save(state.replace(update=np.int32(update)), 1.0)
        monkeypatch.setattr(checkpoint.ocp.Checkpointer, "save", torn)
        with pytest.raises(FolderError, match="3 cannot be written: "):
            saver.save(state.replace(update=np.int32(3)), 1.0)
    assert sorted(os.listdir(tmp_path)) == ["0", "1", "2", "config.json"]


def test_a_checkpoint_that_reads_back_as_another_is_not_taken_for_saved(
    tmp_path, state, monkeypatch
):
    run_folder.create(tmp_path, CONFIG, overwrite=False)
    restore = checkpoint.ocp.Checkpointer.restore

    def other(*arguments, **options):
        found = restore(*arguments, **options)
        changed = jax.tree.map(lambda x: x + np.float32(1e-7), found["policy"])
        return {"policy": changed, "learner": found["learner"]}

    monkeypatch.setattr(checkpoint.ocp.Checkpointer, "restore", other)
    differs = pytest.raises(FolderError, match=r"0 cannot be written: .* policy differs")
    with checkpoint.Saver(tmp_path) as saver, differs:
        saver.save(state.replace(update=np.int32(0)), 1.0)
    assert os.listdir(tmp_path) == ["config.json"]
