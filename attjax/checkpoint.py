"""Run folders: ``config.json``, ``metrics.csv`` and one Orbax checkpoint a saved update.

Each checkpoint holds two items: ``policy``, all that evaluation needs beside config.json,
and ``learner``, all that training needs to go on.
"""

import dataclasses
import functools
import json
import os
import shutil
from pathlib import Path

import jax
import orbax.checkpoint as ocp

from attjax import assembly, settings
from attjax.learner import Learner
from attjax.progress import METRICS
from attjax.settings import Settings

FORMAT = 4
CONFIG = "config.json"
KEPT = 3


class CheckpointError(Exception):
    """A run folder cannot be used; the message is one line for the user."""


@dataclasses.dataclass(frozen=True)
class Config:
    """What a run was started with."""

    preset: str
    seed: int
    settings: Settings


def holds_run(folder: Path) -> bool:
    """Whether a training run was started in the folder."""
    return (folder / CONFIG).is_file()


def create(folder: Path, config: Config, overwrite: bool) -> None:
    """Prepare a folder for a new run.

    Raises:
        CheckpointError: it holds a run and ``overwrite`` is false, holds only something else,
            or cannot be written. It is left as it was. Other files beside a run that is
            overwritten stay.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if holds_run(folder):
            if not overwrite:
                raise CheckpointError(
                    f"{folder} holds a run already: pass --resume to continue it, "
                    f"--overwrite to replace it, or another --checkpoint"
                )
            read_config(folder)
            _remove_run(folder)
        elif any(folder.iterdir()):
            raise CheckpointError(
                f"{folder} is not empty and holds no attjax run; choose another folder"
            )
        write_config(folder, config)
    except OSError as error:
        raise CheckpointError(f"{folder} cannot be written: {error.strerror}") from None


def write_config(folder: Path, config: Config) -> None:
    """Write config.json in one atomic step."""
    content = {"program": "attjax", "format": FORMAT, **dataclasses.asdict(config)}
    temporary = folder / (CONFIG + ".tmp")
    temporary.write_text(json.dumps(content, indent=2) + "\n")
    os.replace(temporary, folder / CONFIG)


def read_config(folder: Path) -> Config:
    """What the run in the folder was started with.

    Raises:
        CheckpointError: the folder is missing, no run of this program or of a newer format.
    """
    path = Path(folder) / CONFIG
    if not Path(folder).is_dir():
        raise CheckpointError(f"there is no checkpoint folder {folder}")
    if not path.is_file():
        raise CheckpointError(f"{folder} is no attjax checkpoint: it has no {CONFIG}")
    try:
        content = json.loads(path.read_text())
        if content["program"] != "attjax":
            raise CheckpointError(f"{path} was written by another program")
        if content["format"] != FORMAT:
            raise CheckpointError(
                f"{path} has format {content['format']}; this version of attjax reads {FORMAT}"
            )
        return Config(
            str(content["preset"]), int(content["seed"]), settings.from_json(content["settings"])
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise CheckpointError(f"{path} cannot be read: {error}") from None


class Saver:
    """Saves learners into a run folder and keeps the newest few; use as a context manager."""

    def __init__(self, folder: Path):
        self._manager = ocp.CheckpointManager(
            Path(folder).absolute(),
            # Synchronous: the next block of updates reuses the buffers that are being written.
            options=ocp.CheckpointManagerOptions(
                max_to_keep=KEPT, enable_async_checkpointing=False
            ),
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._manager.close()

    def save(self, learner: Learner) -> None:
        """Save at once; a checkpoint of the same update is left as it is."""
        update = int(learner.update)
        if update not in self._manager.all_steps():
            self._manager.save(
                update,
                args=ocp.args.Composite(
                    policy=ocp.args.StandardSave(learner.params["policy"]),
                    learner=ocp.args.StandardSave(_storable(learner)),
                ),
            )


def latest(folder: Path) -> int | None:
    """The newest saved update, None if nothing was saved yet."""
    steps = ocp.utils.checkpoint_steps(Path(folder).absolute())
    return max(steps, default=None)


def restore_learner(folder: Path, template: Learner) -> Learner:
    """The newest saved learner, placed like ``template``, one of the same settings.

    The run may have used other devices, or another number of them.
    """
    restored = _restore(folder, "learner", _storable(template))
    implementation = jax.random.key_impl(template.key)
    return restored.replace(key=jax.random.wrap_key_data(restored.key, impl=implementation))


def restore_policy(folder: Path) -> jax.tree_util.Partial:
    """The newest saved policy as ``act(observation, context) -> action``.

    It is placed on the default device wherever it was trained.

    Raises:
        CheckpointError: the folder holds no checkpoint, or an unreadable one.
    """
    policy = assembly.policy(read_config(folder).settings)
    template = jax.eval_shape(functools.partial(assembly.initial_parameters, policy))["policy"]
    params = _restore(folder, "policy", template)
    return jax.tree_util.Partial(policy.act, {"policy": params})


def _restore(folder, item, template):
    update = latest(folder)
    if update is None:
        raise CheckpointError(f"{folder} holds no checkpoint yet")
    device = jax.sharding.SingleDeviceSharding(jax.devices()[0])
    target = jax.tree.map(
        lambda x: jax.ShapeDtypeStruct(x.shape, x.dtype, sharding=x.sharding or device), template
    )
    path = (Path(folder) / str(update) / item).absolute()
    try:
        return ocp.StandardCheckpointer().restore(path, target)
    except Exception as error:  # Orbax raises many kinds for damaged files
        reason = str(error).strip().split("\n")[0][:200]
        raise CheckpointError(f"checkpoint {path} cannot be read: {reason}") from None


def _storable(learner):
    return learner.replace(key=jax.random.key_data(learner.key))


def _remove_run(folder):
    for path in folder.iterdir():
        is_checkpoint = path.is_dir() and path.name.split(".")[0].isdigit()
        if is_checkpoint:
            shutil.rmtree(path)
        elif path.name.removesuffix(".tmp") in (CONFIG, METRICS):
            path.unlink()
