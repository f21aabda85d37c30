"""Train a neural attitude controller.

Example:
    python train.py --num-envs 2048
    python train.py --preset paper-fast --checkpoint runs/fast
"""

import dataclasses
import sys

from attjax import cli, presets, run_folder

DEFAULT_PRESET = "precise"


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
    save_help = "seconds between two checkpoints"
    cli.add_number(parser, "save-every", float, 30.0, save_help, low=0)
    debug_help = "check every operation, and name the first that makes a NaN (slow)"
    parser.add_argument("--debug-nans", action="store_true", help=debug_help)
    cli.add_settings(parser)
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Run a training; returns the exit status."""
    arguments = parse_arguments(argv)
    with cli.one_line_errors("train.py", ValueError):
        preset = arguments.preset or DEFAULT_PRESET
        new = dataclasses.replace(presets.PRESETS[preset], **cli.overrides(arguments))
    with cli.StopSignals() as stop, cli.one_line_errors("train.py", run_folder.FolderError):
        device = cli.select_device(arguments.device)
        advice = "fewer --num-envs or a shorter --rollout-length take less"
        with run_folder.opened(arguments.checkpoint), cli.enough_memory(advice):
            return _train(
                arguments, run_folder.Config(preset, arguments.seed or 0, new), stop, device
            )


def _train(arguments, new, stop, device):
    """Start or continue the run of the folder."""
    # Imported late: with it, --help and errors in the arguments would take seconds.
    from attjax import training

    folder = arguments.checkpoint
    resumes = arguments.resume and run_folder.holds_run(folder)
    if not resumes:
        run_folder.create(folder, new, arguments.overwrite)
        run = training.Run(folder, new, stop)
    else:
        old = run_folder.read_config(folder)
        longer = _resumed_config(arguments, old)
        run = training.Run(folder, longer, stop)
        if longer != old:
            run.announce_longer(old.settings)
            run_folder.write_config(folder, longer)
    run.describe(device)
    return run.train(arguments.save_every, arguments.debug_nans)


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
    return dataclasses.replace(
        config, settings=dataclasses.replace(config.settings, total_steps=total)
    )


if __name__ == "__main__":
    sys.exit(main())
