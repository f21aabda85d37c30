"""Train a neural attitude controller.

Example:
    python train.py --num-envs 2048
    python train.py --preset paper-fast --checkpoint runs/fast
"""

import dataclasses
import importlib
import sys
from pathlib import Path

from attjax import cli, config_file, presets, run_folder

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
    tensorboard_help = "also write TensorBoard's event files, into FOLDER/tensorboard"
    parser.add_argument("--tensorboard", action="store_true", help=tensorboard_help)
    debug_help = "check every operation, and name the first that makes a NaN (slow)"
    parser.add_argument("--debug-nans", action="store_true", help=debug_help)
    config_help = "TOML file with preset, seed and [settings]; flags override it"
    parser.add_argument("--config", type=Path, metavar="FILE", help=config_help)
    print_help = "print the file that reproduces this run, and end"
    parser.add_argument("--print-config", action="store_true", help=print_help)
    cli.add_settings(parser)
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Run a training; returns the exit status."""
    arguments = parse_arguments(argv)
    with cli.one_line_errors("train.py", ValueError):
        given = _given(arguments)
        new = _new_config(**given)
    if arguments.print_config:
        print(config_file.text(new), end="")
        return 0
    with cli.StopSignals() as stop, cli.one_line_errors("train.py", run_folder.FolderError):
        if arguments.tensorboard:
            _check_tensorboard()
        device = cli.select_device(arguments.device)
        advice = "fewer --num-envs or a shorter --rollout-length take less"
        with run_folder.opened(arguments.checkpoint), cli.enough_memory(advice):
            run = _open(arguments, given, new, stop)
            if arguments.tensorboard:
                run.write_events()
            run.describe(device)
            return run.train(arguments.save_every, arguments.debug_nans)


def _check_tensorboard():
    """Fail before anything is written."""
    try:
        importlib.import_module("tensorboardX")
    except ImportError:
        needed = "--tensorboard needs tensorboardX: pip install 'attjax[tensorboard]'"
        raise cli.UserError(needed) from None


def _given(arguments):
    """By name, what the command line says of the run, and the file where it says nothing."""
    given = {} if arguments.config is None else config_file.read(arguments.config)
    for name in ("preset", "seed"):
        if getattr(arguments, name) is not None:
            given[name] = getattr(arguments, name)
    return given | cli.overrides(arguments)


def _new_config(preset=DEFAULT_PRESET, seed=0, **settings):
    return run_folder.Config(preset, seed, dataclasses.replace(presets.PRESETS[preset], **settings))


def _open(arguments, given, new, stop):
    """The folder's run, new or continued."""
    # Imported late: with it, --help and errors in the arguments would take seconds.
    from attjax import training

    folder = arguments.checkpoint
    resumes = arguments.resume and run_folder.holds_run(folder)
    if not resumes:
        run_folder.create(folder, new, arguments.overwrite)
        run = training.Run(folder, new, stop)
    else:
        old = run_folder.read_config(folder)
        longer = _resumed_config(given, old)
        run = training.Run(folder, longer, stop)
        if longer != old:
            run.announce_longer(old.settings)
            run_folder.write_config(folder, longer)
    return run


def _resumed_config(given, config):
    """What the folder's run was started with, with a larger total if one was asked for."""
    total = given.get("total_steps", config.settings.total_steps)
    run = vars(config) | dataclasses.asdict(config.settings) | {"total_steps": total}
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
