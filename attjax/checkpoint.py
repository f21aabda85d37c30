"""Checkpoints in a run folder, one Orbax folder a saved update, named by its number.

Each holds two items: ``policy``, all that evaluation needs beside config.json, and ``learner``,
all that training needs to go on. Orbax writes them beside and renames them when they are whole.
"""

import functools
import json
import logging
import re
import shutil
import sys
import traceback
from pathlib import Path

import jax
import orbax.checkpoint as ocp
from orbax.checkpoint import checkpoint_managers

from attjax import assembly, run_folder
from attjax.learner import Learner
from attjax.networks import Policy
from attjax.run_folder import FolderError

NEWEST_KEPT = 3
BEST_BY = "terminal_error_deg"


def _error(metrics):
    return metrics[BEST_BY]


for name in ("absl", "asyncio"):  # where Orbax logs at length what it also raises
    logging.getLogger(name).setLevel(logging.CRITICAL)

_unraisable = sys.unraisablehook


def _hook(unraisable):
    """Print no traceback of what Orbax leaves be where another array's file fails."""
    files = [frame.filename for frame in traceback.extract_tb(unraisable.exc_traceback)]
    is_orbax = any("orbax" in Path(file).parts for file in files)
    if not is_orbax and str(unraisable.exc_value) != "Event loop is closed":
        _unraisable(unraisable)


class Saver:
    """Saves learners into a run folder; use as a context manager.

    Of the checkpoints it keeps the newest three, and the one with the least terminal error.
    """

    def __init__(self, folder: Path):
        sys.unraisablehook = _hook
        self._folder = Path(folder)
        for leftover in self._folder.glob("[0-9]*.orbax-checkpoint-tmp*"):
            shutil.rmtree(leftover, ignore_errors=True)
        newest = checkpoint_managers.LatestN(NEWEST_KEPT)
        best = checkpoint_managers.BestN(
            get_metric_fn=_error, reverse=True, n=1, keep_checkpoints_without_metrics=False
        )
        self._manager = ocp.CheckpointManager(
            self._folder.absolute(),
            options=ocp.CheckpointManagerOptions(
                best_fn=_error,
                best_mode="min",
                preservation_policy=checkpoint_managers.AnyPreservationPolicy([newest, best]),
                # Synchronous: the next block of updates reuses the buffers that are being written.
                enable_async_checkpointing=False,
            ),
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._manager.close()

    def save(self, learner: Learner, terminal_error: float | None = None) -> None:
        """Save at once; a checkpoint of the same update is left as it is.

        Args:
            learner: what to save.
            terminal_error: of the episodes that ended last, degrees; None if none did.

        Raises:
            FolderError: it cannot be written. Those saved before are as they were.
        """
        update = int(learner.update)
        if update in self._manager.all_steps():
            return
        items = ocp.args.Composite(
            policy=ocp.args.StandardSave(learner.params["policy"]),
            learner=ocp.args.StandardSave(_storable(learner)),
        )
        metrics = {BEST_BY: float("inf") if terminal_error is None else terminal_error}
        try:
            self._manager.save(update, args=items, metrics=metrics)
        except Exception as error:  # Orbax raises many kinds, for a full disk among others
            path, reason = self._folder / str(update), _first_sentence(error)
            raise FolderError(f"checkpoint {path} cannot be written: {reason}") from None


def latest(folder: Path) -> int | None:
    """The newest saved update, None if nothing was saved yet."""
    return max(_saved(folder), default=None)


def best(folder: Path) -> int | None:
    """The saved update with the least terminal error, None if nothing was saved yet.

    Raises:
        FolderError: the error of one cannot be read.
    """
    errors = {}
    for update in _saved(folder):
        path = Path(folder) / str(update) / "metrics" / "metrics"
        try:
            errors[update] = float(_error(json.loads(path.read_text())))
        except FileNotFoundError:  # of a version that did not write it
            errors[update] = float("inf")
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise FolderError(f"{path} cannot be read: {error!r}") from None
    return min(errors, key=errors.get, default=None)


def _saved(folder):
    return ocp.utils.checkpoint_steps(Path(folder).absolute())


def restore_learner(folder: Path, template: Learner) -> Learner:
    """The newest saved learner, placed like ``template``, one of the same settings.

    The run may have used other devices, or another number of them.

    Raises:
        FolderError: the folder holds no checkpoint, an unreadable one or one of another run.
    """
    restored = _restore(folder, latest(folder), "learner", _storable(template))
    implementation = jax.random.key_impl(template.key)
    return restored.replace(key=jax.random.wrap_key_data(restored.key, impl=implementation))


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
    policy = assembly.policy(config.settings, config.spacecraft)
    initial = functools.partial(assembly.initial_parameters, policy, config.spacecraft)
    template = jax.eval_shape(initial)["policy"]
    params = _restore(folder, latest(folder) if update is None else update, "policy", template)
    return policy, {"policy": params}


def _restore(folder, update, item, template):
    if update is None:
        raise FolderError(f"{folder} holds no checkpoint yet")
    path = (Path(folder) / str(update) / item).absolute()
    device = jax.sharding.SingleDeviceSharding(jax.devices()[0])
    target = jax.tree.map(
        lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype, sharding=x.sharding or device), template
    )
    sys.unraisablehook = _hook
    with ocp.StandardCheckpointer() as checkpointer:
        try:
            return checkpointer.restore(path, target)
        except Exception as error:  # Orbax raises many kinds for damaged files
            reason = _first_sentence(error)
    advice = ""
    if len(_saved(folder)) > 1:
        advice = f"; remove {path.parent} to go back to the checkpoint before it"
    raise FolderError(f"checkpoint {path} cannot be read: {reason}{advice}")


def _first_sentence(error):
    """What went wrong, in a line; of a long one the beginning and the end, where the cause is."""
    sentence = re.split(r"\n|\. ", str(error).strip())[0] or type(error).__name__
    return sentence if len(sentence) <= 200 else f"{sentence[:90]} … {sentence[-110:]}"


def _storable(learner):
    return learner.replace(key=jax.random.key_data(learner.key))
