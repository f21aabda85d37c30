"""Checkpoints in a run folder, one Orbax folder a saved update, named by its number.

Each holds two items: ``policy``, all that evaluation needs beside config.json, and ``learner``,
all that training needs to go on; and a label (see :mod:`attjax.runs.belongings`). It is written
aside, read back, and moved into place whole.
"""

import contextlib
import functools
import os
import shutil
from pathlib import Path
from typing import Any

import jax
import numpy as np
import orbax.checkpoint as ocp

from attjax.ppo.networks import Policy
from attjax.ppo.train_state import Learner
from attjax.runs import belongings, build, earlier, items, quiet
from attjax.runs import folder as run_folder
from attjax.runs.folder import FolderError
from attjax.runs.plain_path import plain

NEWEST_KEPT = 3


class Saver:
    """Saves learners into a run folder that is open; use as a context manager.

    Of the run's checkpoints it keeps the newest three, and the one with the least terminal error.
    """

    def __init__(self, folder: Path):
        self._folder, self._run = Path(folder), run_folder.run_id(Path(folder))
        self._orbax = ocp.Checkpointer(ocp.CompositeCheckpointHandler())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with quiet.orbax():
            self._orbax.close()

    def save(self, learner: Learner, terminal_error: float | None = None) -> None:
        """Save at once, and read it back; a checkpoint of the same update is left as it is.

        Args:
            learner: what to save.
            terminal_error: of the episodes that ended last, degrees; None if none did.

        Raises:
            FolderError: it cannot be written, or read back. Those saved before are as they were.
        """
        update = int(learner.update)
        if update in _saved(self._folder):
            return
        saved = {"policy": learner.params["policy"], "learner": _storable(learner)}
        terminal_error = float("inf") if terminal_error is None else terminal_error
        saving = self._folder / belongings.SAVING
        with quiet.orbax() as failures:
            try:
                self._write(saving, saved, terminal_error, update)
            except Exception as error:  # Orbax raises many kinds, for a full disk among others
                failures.append(quiet.first_sentence(error))
            finally:
                shutil.rmtree(saving, ignore_errors=True)
        if failures:
            path = self._folder / str(update)
            raise FolderError(f"checkpoint {path} cannot be written: {failures[0]}")
        for path in self._superseded():
            with contextlib.suppress(OSError):  # tried again after the next save
                belongings.remove(path)

    def _write(self, saving, saved, terminal_error, update):
        shutil.rmtree(saving, ignore_errors=True)
        saving.mkdir()
        whole = saving / "checkpoint"
        with plain(saving) as place:
            arguments = {name: ocp.args.StandardSave(item) for name, item in saved.items()}
            self._orbax.save(place / whole.name, args=ocp.args.Composite(**arguments))
            self._check(place / whole.name, saved)
        belongings.write_label(whole, self._run, terminal_error)
        path = self._folder / str(update)
        if os.path.lexists(path):  # of someone else
            path = path.with_name(path.name + belongings.OWN_NAME)
        os.rename(whole, path)

    def _check(self, path, saved):
        """Read a checkpoint back: it must be what it was made of, to the bit."""
        saved = jax.tree.map(np.asarray, saved)
        templates = {name: ocp.args.StandardRestore(item) for name, item in saved.items()}
        found = self._orbax.restore(path, args=ocp.args.Composite(**templates))
        for name, item in saved.items():
            if not jax.tree.all(jax.tree.map(_same, item, found[name])):
                raise ValueError(f"what was read back of its {name} differs")

    def _superseded(self):
        """The run's checkpoints but for the newest and the best."""
        own = {
            update: path
            for update, path in _saved(self._folder).items()
            if belongings.is_surely_own(path, self._run)
        }
        errors = {update: _error(path) for update, path in own.items()}
        kept = {*list(own)[-NEWEST_KEPT:], _least(errors)}
        return [path for update, path in own.items() if update not in kept]


def _same(a, b):
    b = np.asarray(b)
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def latest(folder: Path) -> int | None:
    """The newest saved update, None if nothing was saved yet."""
    return max(_saved(folder), default=None)


def best(folder: Path) -> int | None:
    """The saved update with the least terminal error, None if nothing was saved yet.

    Raises:
        FolderError: the error of one cannot be read.
    """
    return _least({update: _error(path) for update, path in _saved(folder).items()})


def _error(path):
    try:
        return float(belongings.label(path)[belongings.BEST_BY])
    except FileNotFoundError:  # of a version that did not write it
        return float("inf")
    except (OSError, ValueError, RecursionError) as error:
        raise FolderError(f"{path / belongings.LABEL} cannot be read: {error!r}") from None


def _least(errors):
    """The update with the least error, the newest of equal ones."""
    return min(errors, key=lambda update: (errors[update], -update), default=None)


def _saved(folder):
    """The run's checkpoints by their updates."""
    folder = Path(folder)
    run = run_folder.run_id(folder)
    try:
        return belongings.checkpoints(folder, run)
    except OSError as error:
        raise FolderError(f"{folder} cannot be read: {error.strerror}") from None


def restore_learner(folder: Path, template: Learner) -> Learner:
    """The newest saved learner, placed like ``template``, one of the same settings.

    The run may have used other devices, or another number of them.

    Raises:
        FolderError: the folder holds no checkpoint, an unreadable one or one of another run.
    """
    restore = functools.partial(restore_item, folder, latest(folder), "learner")
    restored = earlier.restored(restore, _storable(template))
    implementation = jax.random.key_impl(template.key)
    return restored.replace(key=jax.random.wrap_key_data(restored.key, impl=implementation))


def load_policy(folder: str | Path, *, use_best: bool = False) -> jax.tree_util.Partial:
    """The policy of a training run, as ``act(observation, context) -> action``: greedy, pure JAX.

    Args:
        folder: of the run, as ``train.py --checkpoint``.
        use_best: take the checkpoint with the least error in training, not the newest.

    Raises:
        FolderError: the folder holds no checkpoint, or an unreadable one.

    Example:
        >>> from attjax import AttitudeEnv, load_policy
        >>> act, env = load_policy("pretrained/precise"), AttitudeEnv(frameskip=5)
        >>> observation, _ = env.reset(jax.random.key(0))
        >>> int(act(observation, env.context(env.default_params))) in range(env.num_actions)
        True
    """
    folder = Path(folder)
    return restore_policy(folder, best(folder) if use_best else None)


def restore_policy(folder: Path, update: int | None = None) -> jax.tree_util.Partial:
    """A saved policy, the newest by default, as ``act(observation, context) -> action``.

    It is placed on the default device wherever it was trained.

    Raises:
        FolderError: the folder holds no checkpoint, an unreadable one or one of another run.
    """
    policy, params = restore_network(folder, update)
    return jax.tree_util.Partial(policy.act, params)


def restore_network(folder: Path, update: int | None = None) -> tuple[Policy, dict]:
    """The same as the policy and its parameters {"policy": ...}, apart.

    Raises:
        FolderError: as :func:`restore_policy`.
    """
    config = run_folder.read_config(folder)
    policy = build.policy(config.settings, config.spacecraft)
    initial = functools.partial(build.initial_parameters, policy, config.spacecraft)
    template = jax.eval_shape(initial)["policy"]
    params = restore_item(folder, latest(folder) if update is None else update, "policy", template)
    return policy, {"policy": params}


def restore_item(
    folder: Path, update: int | None, item: str, template: Any, is_part: bool = False
) -> Any:
    """An item of a checkpoint, or the part of it that ``template`` has, placed like that.

    Raises:
        FolderError: there is no such checkpoint, or it cannot be read.
    """
    if update is None:
        raise FolderError(f"{folder} holds no checkpoint yet")
    saved = _saved(folder)
    if update not in saved:
        raise FolderError(f"{folder} holds no checkpoint {update}")
    path = saved[update]
    device = jax.sharding.SingleDeviceSharding(jax.devices()[0])
    target = jax.tree.map(
        lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype, sharding=x.sharding or device), template
    )
    with quiet.orbax() as failures:
        try:
            with plain(path) as place:
                return items.read(place / item, target, is_part)
        except Exception as error:  # Orbax raises many kinds for damaged files
            failures.append(quiet.first_sentence(error))
    advice = ""
    if len(saved) > 1 and belongings.is_surely_own(path, run_folder.run_id(Path(folder))):
        advice = f"; remove {path} to go back to the checkpoint before it"
    raise FolderError(f"checkpoint {path.absolute() / item} cannot be read: {failures[0]}{advice}")


def _storable(learner):
    return learner.replace(key=jax.random.key_data(learner.key))
