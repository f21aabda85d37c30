"""A run removes what is its own and nothing else; an overwrite that fails has not been."""

import os
import shutil

import pytest
from commands import STEPS_PER_UPDATE, train_script
from setups import CONFIG

from attjax.config import run as run_config
from attjax.runs import belongings, checkpoint
from attjax.runs import folder as run_folder
from attjax.runs.folder import FolderError

NEW = run_config.Config("paper", 1, CONFIG.settings)


def fake_checkpoint(path, run_id, error=1.0):
    """A folder that has all of a checkpoint but the arrays."""
    (path / "policy").mkdir(parents=True)
    (path / "policy" / "_METADATA").touch()
    (path / "learner").mkdir()
    belongings.write_label(path, run_id, error)


def begun(folder, numbers=("1", "2")):
    """A run's folder with checkpoints."""
    folder.mkdir(exist_ok=True)
    run_folder.create(folder, CONFIG, overwrite=False)
    for number in numbers:
        fake_checkpoint(folder / number, run_folder.run_id(folder))
    (folder / "metrics.csv").write_text("old")
    (folder / "tensorboard").mkdir()
    name = belongings.event_name(1, run_folder.run_id(folder))
    (folder / "tensorboard" / name).touch()
    return folder


def names(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_runs_within_a_runs_folder_survive_it(trained, tmp_path):
    """Named by numbers, as those of several seeds are; one by that of a checkpoint to come."""
    folder = tmp_path / "exp"
    shutil.copytree(trained[0], folder)
    others = [folder / number for number in ("1", "2", "3", "61")]
    for other in others:
        shutil.copytree(trained[0], other)
    before = [names(other) for other in others]
    assert checkpoint.latest(folder) == 60
    total = ["--total-steps", str(61 * STEPS_PER_UPDATE)]
    arguments = ["--resume", "--device", "cpu", "--checkpoint", str(folder), *total]
    assert train_script.main(arguments) == 0
    assert [names(other) for other in others] == before
    assert checkpoint.latest(folder) == 61
    checkpoint.restore_policy(folder)
    path = belongings.checkpoints(folder, run_folder.run_id(folder))[61]
    assert path.name == "61.attjax"
    belongings.remove(path)
    assert checkpoint.latest(folder) == 60 and names(folder / "61") == before[-1]


def test_checkpoints_of_another_run_are_none(trained, tmp_path):
    folder = tmp_path / "exp"
    shutil.copytree(trained[0], folder)
    shutil.copytree(folder / "60", folder / "70")
    assert checkpoint.latest(folder) == 70
    shutil.rmtree(folder / "70" / "metrics")
    belongings.write_label(folder / "70", "abc", 0.0)
    assert checkpoint.latest(folder) == checkpoint.best(folder) == 60
    run_folder.create(folder, NEW, overwrite=True)
    assert (folder / "70" / "policy" / "_METADATA").exists() and not (folder / "60").exists()


@pytest.mark.parametrize("name", ["007", "²", "٣", "4.bak", "4.removed", "5.orbax-checkpoint-tmp"])
def test_names_that_a_run_does_not_give_are_no_checkpoints(tmp_path, name):
    folder = begun(tmp_path / "run")
    fake_checkpoint(folder / name, run_folder.run_id(folder))
    before = names(folder / name)
    with run_folder.opened(folder):
        assert checkpoint.latest(folder) == 2
        run_folder.create(folder, NEW, overwrite=True)
    assert names(folder / name) == before


def test_a_copy_beside_a_checkpoint_survives_overwriting(trained, tmp_path):
    folder = tmp_path / "bk"
    shutil.copytree(trained[0], folder)
    shutil.copytree(folder / "60", folder / "60.bak")
    before = names(folder / "60.bak")
    run_folder.create(folder, NEW, overwrite=True)
    assert names(folder / "60.bak") == before
    assert sorted(path.name for path in folder.iterdir()) == ["60.bak", "config.json"]


def test_nobody_is_advised_to_remove_what_is_not_the_runs(trained, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(trained[0], folder)
    shutil.copytree(folder / "60", folder / "61")
    for path in (folder / "61" / "policy").rglob("*"):
        if path.is_file():
            path.write_bytes(b"")
    with pytest.raises(FolderError, match=r"remove .*61 to go back"):
        checkpoint.restore_policy(folder)
    (folder / "61" / belongings.LABEL).unlink()  # so it may be anyone's
    with pytest.raises(FolderError, match=r"61.*cannot be read") as error:
        checkpoint.restore_policy(folder)
    assert "remove" not in str(error.value)


def test_a_run_of_before_labels_had_runs_goes_on(trained, tmp_path):
    """Neither its configuration nor its checkpoints say which run they are of."""
    folder = begun(tmp_path / "run", ())
    text = (folder / "config.json").read_text()
    (folder / "config.json").write_text(text.replace('"run"', '"was"', 1))
    for number in ("1", "2"):
        fake_checkpoint(folder / number, None)
    (folder / "3.removed").mkdir()
    (folder / "4.orbax-checkpoint-tmp-1").mkdir()
    with run_folder.opened(folder):
        assert checkpoint.latest(folder) == 2
        assert not (folder / "3.removed").exists()
        assert not (folder / "4.orbax-checkpoint-tmp-1").exists()
        run_folder.create(folder, NEW, overwrite=True)
    assert not (folder / "1").exists() and run_folder.run_id(folder)


def test_overwriting_removes_the_run_and_nothing_else(tmp_path):
    folder = begun(tmp_path / "run")
    (folder / "figure.png").write_text("precious")
    (folder / "9").mkdir()
    run_folder.create(folder, NEW, overwrite=True)
    kept = [name for name in names(folder) if not name.startswith("tensorboard/")]
    assert kept == ["9", "config.json", "figure.png"]


def test_of_a_linked_checkpoint_the_link_is_removed(tmp_path):
    folder = begun(tmp_path / "run")
    (folder / "2").rename(tmp_path / "elsewhere")
    (folder / "2").symlink_to(tmp_path / "elsewhere")
    before = names(tmp_path / "elsewhere")
    assert checkpoint.latest(folder) == 2
    run_folder.create(folder, NEW, overwrite=True)
    assert names(folder) == ["config.json"]
    assert names(tmp_path / "elsewhere") == before
    (folder / "3").symlink_to(tmp_path / "elsewhere")
    belongings.remove(folder / "3")
    assert not os.path.lexists(folder / "3") and names(tmp_path / "elsewhere") == before


def test_overwriting_that_fails_has_changed_nothing(tmp_path, monkeypatch):
    """At each of its moves in turn, as in a folder with files that are another user's."""
    for step in range(100):
        folder = begun(tmp_path / str(step))
        before, config = names(folder), run_folder.read_config(folder)
        moves = []

        def move(*arguments, step=step, moves=moves, rename=os.rename):
            moves.append(arguments)
            if len(moves) == step + 1:
                raise PermissionError(13, "Permission denied")
            return rename(*arguments)

        with monkeypatch.context() as patch:
            patch.setattr(os, "rename", move)
            patch.setattr(os, "replace", move)
            try:
                run_folder.create(folder, NEW, overwrite=True)
            except FolderError as error:
                assert "cannot be written: Permission denied" in str(error)
            else:
                break
        assert names(folder) == before and run_folder.read_config(folder) == config
    assert 5 < step < 99


@pytest.mark.skipif(os.geteuid() == 0, reason="root may remove anything")
def test_a_checkpoint_that_may_not_be_removed_keeps_the_run_as_it_was(tmp_path):
    folder = begun(tmp_path / "run")
    before = names(folder)
    (folder / "2" / "policy").chmod(0o500)
    with pytest.raises(FolderError, match="cannot be written: Permission denied"):
        run_folder.create(folder, NEW, overwrite=True)
    assert names(folder) == before and run_folder.read_config(folder) == CONFIG


def test_what_may_not_be_removed_is_seen_before_anything_is_moved(tmp_path, monkeypatch):
    folder = begun(tmp_path / "run")
    before = names(folder)
    may = os.access
    monkeypatch.setattr(os, "access", lambda path, mode: may(path, mode) and "learner" not in path)
    with pytest.raises(FolderError, match=r"cannot be written: Permission denied .*learner"):
        run_folder.create(folder, NEW, overwrite=True)
    assert names(folder) == before and run_folder.read_config(folder) == CONFIG


def test_overwriting_that_is_killed_leaves_the_old_run_or_the_new_one(tmp_path, monkeypatch):
    """Killed at each of its steps in turn; the next start finds one of them whole."""
    for step in range(100):
        folder = begun(tmp_path / str(step))
        before = names(folder)
        overwrite = lambda folder=folder: run_folder.create(folder, NEW, True)  # noqa: E731
        if not killed_at(step, overwrite, monkeypatch):
            break
        config = run_folder.read_config(folder)
        with run_folder.opened(folder):
            pass
        if config == CONFIG:
            assert names(folder) == before
        else:
            assert config == NEW
            assert set(names(folder)) <= {"config.json", "tensorboard"}
    assert 5 < step < 99
    assert names(folder) == ["config.json"]


def killed_at(step, action, monkeypatch) -> bool:
    """Run an action that dies before its ``step``-th change to the file system; whether it did."""
    changes = []

    def counted(function):
        def call(*arguments, **options):
            changes.append(function)
            if len(changes) > step:
                raise KeyboardInterrupt
            return function(*arguments, **options)

        return call

    with monkeypatch.context() as patch:
        for name in ("unlink", "rename", "rmdir", "replace", "mkdir"):
            patch.setattr(os, name, counted(getattr(os, name)))
        try:
            action()
        except KeyboardInterrupt:
            return True
    return False
