"""Where a new run begins: anew, or with the networks of another run (``--resume-from``)."""

import os
from pathlib import Path

from attjax.config import run as run_config
from attjax.config.run import Config, Origin
from attjax.errors import UserError, UserValueError
from attjax.runs import belongings
from attjax.runs import folder as run_folder
from attjax.runs.folder import FolderError


def new(given: dict) -> Config:
    """The configuration of a new run of what is given by name.

    Where ``resume_from`` is, the folder of a run, it has that run's networks as they are in the
    newest checkpoint, and all that is not given.

    Raises:
        FolderError: that folder holds no checkpoint, or cannot be read.
        ValueError: as :func:`attjax.config.run.new` and :func:`attjax.config.run.continued`.
    """
    others = {name: x for name, x in given.items() if name != "resume_from"}
    if "resume_from" not in given:
        return run_config.new(**others)
    folder = Path(run_config.real_path(given["resume_from"]))
    old, run = run_folder.read_config(folder), run_folder.run_id(folder)
    try:
        saved = belongings.checkpoints(folder, run)
    except OSError as error:
        raise FolderError(f"{folder} cannot be read: {error.strerror}") from None
    if not saved:
        raise FolderError(f"{folder} holds no checkpoint yet")
    update, path = max(saved.items())
    origin = Origin(str(folder), run, update, (path / "learner").is_dir())
    try:
        return run_config.continued(old, origin, others)
    except UserError:
        raise
    except ValueError as error:
        raise UserValueError(str(error)) from None


def check_other(config: Config, folder: Path) -> None:
    """Check that a new run does not begin from the folder that it is to be kept in.

    Raises:
        UserValueError: it does.
    """
    origin = config.resumed_from
    if origin is not None and origin.folder == os.path.realpath(folder):
        raise UserValueError(
            f"--resume-from and --checkpoint are both {folder}; --resume goes on with its run"
        )
