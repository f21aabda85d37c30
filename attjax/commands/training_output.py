"""What ``train.py`` prints of a run: what it is, how it goes, how it ended."""

from pathlib import Path

import jax

from attjax import errors
from attjax.config import command_line, presets
from attjax.config.settings import Settings
from attjax.ppo import train_state
from attjax.runs.progress import Progress
from attjax.runs.run import Diverged, Run
from attjax.runs.signals import StopSignals
from attjax.runs.trainer import Observer

DIVERGED = 3


class Terminal(Observer):
    """Shows a run on the terminal, or in a log, and ends it where a signal asks for that.

    Args:
        folder: of the run, as the user wrote it.
        device: that computes.
        stop: the signals.
    """

    _progress: Progress  # from compiled() on

    def __init__(self, folder: Path, device: jax.Device, stop: StopSignals):
        self._folder, self._device, self._stop = folder, device, stop

    def started(self, run: Run, lengthened_from: Settings | None) -> None:
        """Print what the run is, and where it stands."""
        if lengthened_from is not None:
            _announce_longer(run, lengthened_from)
        config, device = run.config, self._device
        ppo = config.settings.ppo
        print(
            f"preset {config.preset}, {config.spacecraft.name}, seed {config.seed}, "
            f"{run.total_steps:,} agent steps "
            f"({ppo.num_updates:,} updates of {ppo.steps_per_update:,}) on "
            f"{run.setup.num_devices} x {device.device_kind} ({device.platform}), in {self._folder}"
        )
        if config.preset in presets.REMARKS:
            print(presets.REMARKS[config.preset])
        if device.platform == "gpu" and config.preset in presets.ON_A_GPU:
            print(presets.ON_A_GPU[config.preset])
        if config.resumed_from is not None and not run.update:
            print(_beginning(config.resumed_from))
        if run.update:
            print(f"resumed at {run.agent_steps:,} agent steps")

    def compiled(self, run: Run, seconds: float | None) -> None:
        """Print how long that took, and begin to show the progress."""
        if seconds is not None:
            print(f"compiled in {seconds:.1f} s", flush=True)
        self._progress = Progress(run.total_steps, run.agent_steps, run.rows, self._stop)
        self._progress.__enter__()

    def block(self, row: dict) -> None:
        """Show it."""
        self._progress.show(row)

    def wants_to_stop(self) -> bool:
        """Whether a signal was received."""
        return self._stop.received is not None

    def ended(self) -> None:
        """Leave the last state of the progress."""
        self._progress.__exit__(None, None, None)

    def outcome(self, run: Run) -> int:
        """Print how it ended; returns the exit status."""
        if self._stop.received is not None:
            print(f"stopped and saved at {run.agent_steps:,} agent steps; continue with --resume")
            return 128 + self._stop.received
        folder = command_line.quoted(self._folder)
        print(f"trained; evaluate with: {command_line.invocation('eval')} --checkpoint {folder}")
        return 0


def diverged(error: Diverged) -> int:
    """Print what was not finite; returns the exit status."""
    errors.error_line(error)
    return DIVERGED


def _beginning(origin):
    """What networks it begins with."""
    value = "" if origin.has_value else ", which holds no value network: that begins anew"
    return f"begins with the networks of update {origin.update} of {origin.folder}{value}"


def _announce_longer(run, before):
    """Print what a larger total than before changes from here on."""
    old, new = before.ppo, run.config.settings.ppo
    steps = run.update * new.passes * new.minibatches
    slow, fast = (train_state.learning_rate(ppo, steps) for ppo in (old, new))
    print(
        f"total steps raised from {old.total_steps:,} to {new.total_steps:,}: "
        f"at {run.agent_steps:,} the learning rate goes from {slow:.3g} to {fast:.3g}, and from "
        f"there to {new.final_learning_rate:.3g} at the new end; the entropy bonus likewise"
    )
