"""The networks that a run begins with, where they are another run's."""

import functools
from pathlib import Path

import jax

from attjax.config.run import Config, Origin
from attjax.ppo.train_state import Setup
from attjax.runs import build, checkpoint
from attjax.runs import folder as run_folder
from attjax.runs.folder import FolderError


def networks(config: Config, setup: Setup) -> dict:
    """Parameters {"policy", "value"} of the checkpoint that a run begins with, to the bit.

    Empty where it begins anew; without "value" where the checkpoint holds a policy only.

    Raises:
        FolderError: the folder is gone or holds another run, or the checkpoint is gone or cannot
            be read.
    """
    if config.resumed_from is None:
        return {}
    initial = functools.partial(build.initial_parameters, setup.policy, config.spacecraft)
    try:
        return _restored(config.resumed_from, jax.eval_shape(initial))
    except FolderError as error:
        raise FolderError(f"the run begins with networks of another: {error}") from None


def _restored(origin: Origin, template: dict) -> dict:
    folder = Path(origin.folder)
    run_folder.read_config(folder)
    if run_folder.run_id(folder) != origin.run:
        raise FolderError(f"{folder} holds another run now")
    restore = functools.partial(checkpoint.restore_item, folder, origin.update)
    networks = {"policy": restore("policy", template["policy"])}
    if origin.has_value:
        part = {"params": {"value": template["value"]}}
        networks["value"] = restore("learner", part, is_part=True)["params"]["value"]
    return networks
