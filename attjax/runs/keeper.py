"""Keeps a training run in a folder: rows of metrics, checkpoints, TensorBoard's events."""

import dataclasses
import importlib
import time
from pathlib import Path
from typing import Protocol

from attjax.config import run as run_config
from attjax.errors import UserError
from attjax.runs import beginning, build, checkpoint, metrics_file, origin
from attjax.runs import folder as run_folder
from attjax.runs.run import Run


@dataclasses.dataclass(frozen=True, kw_only=True)
class Place:
    """A folder that a run is kept in, and how.

    Attributes:
        folder: made where there is none.
        resume: go on with its run, if it holds one.
        overwrite: replace its run, if it holds one.
        save_every: time between two checkpoints, s; one more is written at the end.
        tensorboard: write TensorBoard's event files as well.

    Raises:
        ValueError: it is to go on with a run and to replace it.
        UserError: tensorboardX is asked for and is not installed.
    """

    folder: Path
    resume: bool = False
    overwrite: bool = False
    save_every: float = 30.0
    tensorboard: bool = False

    def __post_init__(self):
        object.__setattr__(self, "folder", Path(self.folder))
        if self.resume and self.overwrite:
            raise ValueError("resume and overwrite are both true; they exclude each other")
        if self.tensorboard:
            try:
                importlib.import_module("tensorboardX")  # before anything is written
            except ImportError:
                raise UserError(
                    "--tensorboard needs tensorboardX: pip install 'attjax[tensorboard]'"
                ) from None


class _Log(Protocol):
    """A file of rows of metrics."""

    def append(self, row: dict) -> None:
        """Add one row."""


class Keeper:
    """Keeps one run; a context manager. Its folder must be open.

    Attributes:
        lengthened_from: the settings of the run before it was given a larger total; None if not.

    Raises:
        FolderError: the folder's run is refused, cannot be read or cannot be written.
    """

    def __init__(self, place: Place, given: dict):
        """Begin or continue the folder's run, with what is given of it by name."""
        self._place, folder = place, place.folder
        self.lengthened_from = None
        goes_on = place.resume and run_folder.holds_run(folder)
        if goes_on:
            old = run_folder.read_config(folder)
            config = run_config.lengthened(old, given)
            self.lengthened_from = old.settings if config != old else None
        else:
            config = origin.new(given)
            origin.check_other(config, folder)
        # Before a run gives way to this one: it fails where a user's function cannot be used, or
        # the networks that it begins with not be read.
        setup, networks = build.of_config(config), {}
        if not goes_on or checkpoint.latest(folder) is None:
            networks = beginning.networks(config, setup)
        if not goes_on:
            run_folder.create(folder, config, place.overwrite)
        self.run = Run(config, setup, networks)
        saved = self.run.learner
        if checkpoint.latest(folder) is not None:
            saved = checkpoint.restore_learner(folder, saved)
        steps = int(saved.update) * config.settings.ppo.steps_per_update
        file = metrics_file.MetricsFile(folder, steps)
        self.run.go_on_from(saved, file.kept, file.wall_s)
        self._logs: list[_Log] = [file]
        if place.tensorboard:
            from attjax.runs import tensorboard

            self._logs.append(tensorboard.EventFile(folder, config, file.kept))
        if self.lengthened_from is not None:
            run_folder.write_config(folder, config)

    def __enter__(self):
        self._saver = checkpoint.Saver(self._place.folder).__enter__()
        self._saved = time.monotonic()
        return self

    def __exit__(self, *details):
        self._saver.__exit__(*details)

    def add(self, row: dict) -> None:
        """Write a row of metrics, and a checkpoint where one is due.

        Raises:
            FolderError: the folder cannot be written. Its checkpoints are as they were.
        """
        for log in self._logs:
            log.append(row)
        if time.monotonic() - self._saved > self._place.save_every:
            self.save()
            self._saved = time.monotonic()

    def save(self) -> None:
        """Write a checkpoint.

        Raises:
            FolderError: the folder cannot be written. Its checkpoints are as they were.
        """
        self._saver.save(self.run.learner, self.run.terminal_error)

    def describe_saved(self) -> str:
        """What the folder has of the run, for who lost the learner."""
        update = checkpoint.latest(self._place.folder)
        kept = "no checkpoint yet" if update is None else f"the good one of update {update}"
        return f"{self._place.folder} has {kept}"
