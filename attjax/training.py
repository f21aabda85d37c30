"""A training run: blocks of updates, and between them metrics, checkpoints and signals."""

import time
from pathlib import Path

import jax

from attjax import (
    assembly,
    checkpoint,
    cli,
    errors,
    learner,
    metrics,
    metrics_file,
    nan_search,
    ppo,
    progress,
)
from attjax.run_folder import Config
from attjax.settings import Settings
from attjax.signals import StopSignals

DIVERGED = 3


class Run:
    """A training run in its folder, at its start or at its newest checkpoint.

    Args:
        folder: where its checkpoints and metrics are; open.
        config: what it was started with.
        setup: made of it.
        stop: says when to end after a block.

    Raises:
        FolderError: the folder's checkpoint or metrics cannot be read.
    """

    def __init__(self, folder: Path, config: Config, setup: learner.Setup, stop: StopSignals):
        self.folder, self.config, self.settings, self.stop = folder, config, config.settings, stop
        self.setup, self.env_params = setup, assembly.env_params(setup)
        self.learner = learner.init(self.setup, self.env_params, jax.random.key(config.seed))
        if checkpoint.latest(folder) is not None:
            self.learner = checkpoint.restore_learner(folder, self.learner)
        self.update = int(self.learner.update)
        self.metrics_file = metrics_file.MetricsFile(folder, self.agent_steps)
        self.logs = [self.metrics_file]
        self.terminal_error = None

    @property
    def agent_steps(self) -> int:
        """Agent steps done."""
        return self.update * self.settings.ppo.steps_per_update

    @property
    def goes_on(self) -> bool:
        """Whether there is another block to run."""
        return self.update < self.settings.ppo.num_updates and self.stop.received is None

    def describe(self, device) -> None:
        """Print what the run is, and where it stands."""
        settings = self.settings
        craft = self.config.spacecraft
        print(
            f"preset {self.config.preset}, {craft.name}, seed {self.config.seed}, "
            f"{settings.ppo.num_updates * settings.ppo.steps_per_update:,} agent steps "
            f"({settings.ppo.num_updates:,} updates of {settings.ppo.steps_per_update:,}) on "
            f"{self.setup.num_devices} x {device.device_kind} ({device.platform}), in {self.folder}"
        )
        if self.update:
            print(f"resumed at {self.agent_steps:,} agent steps")

    def write_events(self) -> None:
        """Write TensorBoard's event file, too.

        Raises:
            ImportError: tensorboardX is not installed.
            FolderError: it cannot be written.
        """
        from attjax import tensorboard

        self.logs.append(tensorboard.EventFile(self.folder, self.config, self.metrics_file.kept))

    def announce_longer(self, before: Settings) -> None:
        """Print what a larger total than ``before``'s changes from here on."""
        old, new = before.ppo, self.settings.ppo
        steps = self.update * new.passes * new.minibatches
        slow, fast = (learner.learning_rate(ppo, steps) for ppo in (old, new))
        print(
            f"total steps raised from {old.total_steps:,} to {new.total_steps:,}: "
            f"at {self.agent_steps:,} the learning rate goes from {slow:.3g} to {fast:.3g}, "
            f"and from there to {new.final_learning_rate:.3g} at the new end; the entropy bonus "
            f"likewise"
        )

    def train(self, save_every_s: float, debug_nans: bool = False) -> int:
        """Train to the end, or to a signal; returns the exit status.

        Raises:
            FolderError: the folder cannot be written. Its checkpoints are as they were.
        """
        train_block = self._compiled(debug_nans) if self.goes_on else None
        total = self.settings.ppo.num_updates * self.settings.ppo.steps_per_update
        rows = self.metrics_file.kept
        with checkpoint.Saver(self.folder) as saver:
            with progress.Progress(total, self.agent_steps, rows, self.stop) as view:
                diverged = self._loop(train_block, saver, view, save_every_s)
            if diverged:
                errors.error_line(diverged)
                return DIVERGED
            saver.save(self.learner, self.terminal_error)
        if self.stop.received is not None:
            print(f"stopped and saved at {self.agent_steps:,} agent steps; continue with --resume")
            return 128 + self.stop.received
        folder = cli.quoted(self.folder)
        print(f"trained; evaluate with: {cli.invocation('eval')} --checkpoint {folder}")
        return 0

    def _compiled(self, debug_nans):
        start = time.monotonic()
        arguments = self.setup, self.env_params, self.learner
        if debug_nans:
            train_block = nan_search.train_block(*arguments)
        else:
            train_block = ppo.train_block.lower(*arguments, 1).compile()
        print(f"compiled in {time.monotonic() - start:.1f} s", flush=True)
        return train_block

    def _loop(self, train_block, saver, view, save_every_s):
        """Run blocks until the end or a signal; returns what diverged, if anything."""
        start, saved = time.monotonic() - self.metrics_file.wall_s, time.monotonic()
        while self.goes_on:
            count = min(
                self.settings.logging.updates_per_block, self.settings.ppo.num_updates - self.update
            )
            try:
                self.learner, block = train_block(self.env_params, self.learner, count)
            except nan_search.NotFinite as found:
                return self._divergence(self.update, count, str(found))
            diverged = {name: int(update) for name, update in block["diverged"].items()}
            if max(diverged.values()) >= 0:
                first = min(update for update in diverged.values() if update >= 0)
                names = ", ".join(name for name, update in diverged.items() if update == first)
                return self._divergence(first, 1, names)
            self.update += count
            row = metrics.block_row(
                block, self.settings.task.frameskips, self.agent_steps, time.monotonic() - start
            )
            self.terminal_error = row["terminal_error_deg"]
            for log in self.logs:
                log.append(row)
            view.show(row)
            if time.monotonic() - saved > save_every_s:
                saver.save(self.learner, self.terminal_error)
                saved = time.monotonic()
        return None

    def _divergence(self, update, count, what):
        """One line that says in which of the updates what was not finite."""
        steps = (update + count) * self.settings.ppo.steps_per_update
        updates = f"update {update}" if count == 1 else f"updates {update} to {update + count - 1}"
        kept = checkpoint.latest(self.folder)
        kept = "no checkpoint yet" if kept is None else f"the good one of update {kept}"
        return f"not finite at agent step {steps:,} ({updates}): {what}; {self.folder} has {kept}"
