"""Train a neural attitude controller.

Example:
    python train.py --num-envs 2048
    python train.py --preset paper-fast --checkpoint runs/fast
"""

import dataclasses
import signal
import sys
import time

from attjax import cli, presets

DEFAULT_PRESET = "precise"
DIVERGED = 3
SAVE_EVERY_S = 30.0


def parse_arguments(argv):
    parser = cli.Parser(prog="train.py", description=__doc__)
    parser.add_argument(
        "--preset", choices=presets.PRESETS, help=f"the recipe (default: {DEFAULT_PRESET})"
    )
    cli.add_common(parser, seed_help="of everything random (default: 0)")
    existing = parser.add_mutually_exclusive_group()
    resume_help = "continue the folder's run, or start it if there is none"
    existing.add_argument("--resume", action="store_true", help=resume_help)
    existing.add_argument("--overwrite", action="store_true", help="replace the folder's run")
    cli.add_settings(parser)
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Run a training; returns the exit status."""
    arguments = parse_arguments(argv)
    with cli.one_line_errors("train.py", ValueError):
        preset = arguments.preset or DEFAULT_PRESET
        new = dataclasses.replace(presets.PRESETS[preset], **cli.overrides(arguments))
    with cli.one_line_errors("train.py"):
        device = cli.select_device(arguments.device)

    # Imported late: with them, --help and errors in the arguments would take seconds.
    from attjax import checkpoint

    with cli.one_line_errors("train.py", checkpoint.CheckpointError):
        folder = arguments.checkpoint
        if arguments.resume and checkpoint.holds_run(folder):
            config = _resumed_config(arguments, checkpoint.read_config(folder))
            checkpoint.write_config(folder, config)
        else:
            config = checkpoint.Config(preset, arguments.seed or 0, new)
            checkpoint.create(folder, config, arguments.overwrite)
    return Run(folder, config, device).train()


def _resumed_config(arguments, config):
    """The folder's run, with a larger total if one was asked for."""
    given = cli.overrides(arguments)
    total = given.pop("total_steps", config.settings.total_steps)
    for name in ("preset", "seed"):
        if getattr(arguments, name) is not None:
            given[name] = getattr(arguments, name)
    run = vars(config) | dataclasses.asdict(config.settings)
    differing = [name for name, value in given.items() if run[name] != value]
    if differing:
        listed = ", ".join(f"{name} ({run[name]})" for name in differing)
        raise cli.UserError(f"--resume keeps the run's settings; leave out {listed}")
    if total < config.settings.total_steps:
        raise cli.UserError(
            f"--total-steps is {total}; to resume, it must be at least the run's "
            f"{config.settings.total_steps}"
        )
    if total > config.settings.total_steps:
        print(f"total steps raised to {total:,}: the learning rate follows the longer schedule")
    return dataclasses.replace(
        config, settings=dataclasses.replace(config.settings, total_steps=total)
    )


class Run:
    """One training run in its folder."""

    def __init__(self, folder, config, device):
        import jax

        from attjax import assembly, checkpoint, learner, progress

        self.folder, self.config = folder, config
        self.settings = config.settings
        self.setup = assembly.setup(config.settings, assembly.num_devices(config.settings))
        self.env_params = assembly.env_params(self.setup)
        self.learner = learner.init(self.setup, self.env_params, jax.random.key(config.seed))
        if checkpoint.latest(folder) is not None:
            with cli.one_line_errors("train.py", checkpoint.CheckpointError):
                self.learner = checkpoint.restore_learner(folder, self.learner)
        self.update = int(self.learner.update)
        self.metrics_file = progress.MetricsFile(folder, self.agent_steps)
        self.stopped_by = None
        total = self.settings.num_updates * self.settings.steps_per_update
        print(
            f"preset {config.preset}, seed {config.seed}, {total:,} agent steps "
            f"({self.settings.num_updates:,} updates of {self.settings.steps_per_update:,}) "
            f"on {self.setup.num_devices} x {device.device_kind} ({device.platform}), in {folder}"
        )
        if self.update:
            print(f"resumed at {self.agent_steps:,} agent steps")

    @property
    def agent_steps(self) -> int:
        """Agent steps done."""
        return self.update * self.settings.steps_per_update

    def train(self) -> int:
        """Train to the end, or to a signal; returns the exit status."""
        signals = (signal.SIGINT, signal.SIGTERM)
        previous = {number: signal.signal(number, self._stop) for number in signals}
        try:
            return self._train()
        finally:
            for number, handler in previous.items():
                signal.signal(number, handler)

    def _train(self):
        from attjax import checkpoint, ppo, progress

        start = time.monotonic()
        lowered = ppo.train_block.lower(self.setup, self.env_params, self.learner, 1)
        train_block = lowered.compile()
        print(f"compiled in {time.monotonic() - start:.1f} s", flush=True)
        total = self.settings.num_updates * self.settings.steps_per_update
        with checkpoint.Saver(self.folder) as saver:
            with progress.ProgressLine(total, self.agent_steps) as line:
                diverged = self._loop(train_block, saver, line)
            if diverged:
                print(f"train.py: error: {diverged}", file=sys.stderr)
                return DIVERGED
            saver.save(self.learner)
        return self._finish()

    def _loop(self, train_block, saver, line):
        """Run blocks until the end or a signal; returns what diverged, if anything."""
        from attjax import progress

        start, saved = time.monotonic() - self.metrics_file.wall_s, time.monotonic()
        while self.update < self.settings.num_updates and self.stopped_by is None:
            count = min(self.settings.updates_per_block, self.settings.num_updates - self.update)
            self.learner, metrics = train_block(self.env_params, self.learner, count)
            diverged = {name: int(update) for name, update in metrics["diverged"].items()}
            if max(diverged.values()) >= 0:
                return self._divergence(diverged)
            self.update += count
            row = progress.metrics_row(metrics, self.agent_steps, time.monotonic() - start)
            self.metrics_file.append(row)
            line.show(row)
            if time.monotonic() - saved > SAVE_EVERY_S:
                saver.save(self.learner)
                saved = time.monotonic()
        return None

    def _divergence(self, diverged):
        """One line that names the first update with something not finite, and what it was."""
        first = min(update for update in diverged.values() if update >= 0)
        names = ", ".join(name for name, update in diverged.items() if update == first)
        steps = (first + 1) * self.settings.steps_per_update
        return (
            f"not finite at agent step {steps:,} (update {first}): {names}; "
            f"{self.folder} keeps the last good checkpoint"
        )

    def _finish(self):
        if self.stopped_by is not None:
            print(f"stopped and saved at {self.agent_steps:,} agent steps; continue with --resume")
            return 128 + self.stopped_by
        print(f"trained; evaluate with: python eval.py --checkpoint {self.folder}")
        return 0

    def _stop(self, number, _):
        self.stopped_by = number


if __name__ == "__main__":
    sys.exit(main())
