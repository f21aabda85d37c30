"""Train a neural attitude controller by PPO, in a vectorised simulator."""

import argparse
from collections.abc import Sequence

from attjax import devices, errors
from attjax.config import command_line, fields, presets, toml
from attjax.config import run as run_config
from attjax.runs import origin, signals

USAGE = "%(prog)s [--preset NAME] [--checkpoint FOLDER] [--resume] [FLAG ...]"
EXAMPLES = """\
An agent step is an impulse and the free rotation after it. Symbols, equations
and tables are the paper's; λ is that of generalised advantage estimation.

examples:
  python train.py                             the default preset, into ckpt/
  python train.py --resume                    after Ctrl-C or a crash
  python train.py --preset paper-fast --checkpoint runs/fast
  python train.py --hidden-sizes 128,128 --seed 1 --checkpoint runs/wide
  python train.py --preset paper --print-config > run.toml
  python train.py --config run.toml --checkpoint runs/paper
  python train.py --spacecraft mine.toml --checkpoint runs/mine
  python train.py --resume-from ckpt --spacecraft mine.toml --checkpoint new
"""


def parse_arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = command_line.Parser(
        usage=USAGE, description=__doc__, epilog=command_line.examples(EXAMPLES)
    )
    groups = {name: parser.add_argument_group(title) for name, title in fields.GROUPS.items()}
    remarks = "; ".join(presets.REMARKS.values()).replace("%", "%%")
    default = run_config.DEFAULT_PRESET
    names = ", ".join(presets.PRESETS)
    preset_help = f"the recipe: {names}; flags override it; {remarks} (default: {default})"
    groups["run"].add_argument(
        "--preset", choices=presets.PRESETS, metavar="NAME", help=preset_help
    )
    craft_help = "TOML file that describes the spacecraft and its task (default: LM50, the paper's)"
    groups["task"].add_argument(
        "--spacecraft", type=command_line.path, metavar="FILE", help=craft_help
    )
    command_line.add_world(groups["task"], "ideal")
    for name, group in groups.items():
        command_line.add_settings(group, name)
    _add_run(groups["run"])
    _add_logging(groups["logging"])
    return parser.parse_args(argv)


def _add_run(group):
    command_line.add_checkpoint(group)
    existing = group.add_mutually_exclusive_group()
    resume_help = "continue the folder's run, or start it if there is none"
    existing.add_argument("--resume", action="store_true", help=resume_help)
    existing.add_argument("--overwrite", action="store_true", help="replace the folder's run")
    from_help = (
        "a new run that begins with the networks of this folder's, and is like it but for flags"
    )
    group.add_argument("--resume-from", type=command_line.path, metavar="FOLDER", help=from_help)
    command_line.add_seed_and_device(group, "seed of everything random")
    config_help = (
        "TOML file with preset, seed, resume_from, [settings], [spacecraft] and [world]; "
        "flags override it"
    )
    group.add_argument("--config", type=command_line.path, metavar="FILE", help=config_help)
    print_help = "print the file that reproduces this run, and end"
    group.add_argument("--print-config", action="store_true", help=print_help)


def _add_logging(group):
    save_help = "time between two checkpoints"
    command_line.add_number(group, "save-every", float, 30.0, save_help, unit="s", low=0)
    tensorboard_help = "also write TensorBoard's event files, into FOLDER/tensorboard"
    group.add_argument("--tensorboard", action="store_true", help=tensorboard_help)
    debug_help = "check every operation, and name the first that makes a NaN (slow)"
    group.add_argument("--debug-nans", action="store_true", help=debug_help)


@errors.program("train.py")
def main(argv: Sequence[str] | None = None) -> int:
    """Run a training; returns the exit status."""
    arguments = parse_arguments(argv)
    with errors.one_line_errors(ValueError):
        given = _given(arguments)
        if arguments.print_config or "resume_from" not in given:
            new = origin.new(given)
    if arguments.print_config:
        print(toml.text(new), end="")
        return 0
    with signals.StopSignals() as stop, errors.one_line_errors():
        place = {
            "folder": arguments.checkpoint,
            "resume": arguments.resume,
            "overwrite": arguments.overwrite,
            "save_every": arguments.save_every,
            "tensorboard": arguments.tensorboard,
        }
        return _train(given, place, stop, arguments)


def _train(given, place, stop, arguments):
    device = devices.select_device(arguments.device)
    # Imported late: with them, --help and errors in the arguments would take seconds.
    from attjax.commands import training_output
    from attjax.runs import trainer
    from attjax.runs.keeper import Place
    from attjax.runs.run import Diverged

    place = Place(**place)
    view = training_output.Terminal(place.folder, device, stop)
    advice = "fewer --num-envs or a shorter --rollout-length take less"
    try:
        with errors.enough_memory(advice):
            run = trainer.train(
                **given, folder=place, callback=view, debug_nans=arguments.debug_nans
            )
    except Diverged as error:
        return training_output.diverged(error)
    return view.outcome(run)


def _given(arguments):
    """By name, what the command line says of the run, and the file where it says nothing."""
    given = {} if arguments.config is None else toml.read(arguments.config)
    for name in ("preset", "seed", "resume_from"):
        if getattr(arguments, name) is not None:
            given[name] = getattr(arguments, name)
    if arguments.spacecraft is not None:
        given["spacecraft"] = toml.read_spacecraft(arguments.spacecraft)
    if arguments.world is not None:
        given["world"] = toml.read_world(arguments.world)
    return given | command_line.overrides(arguments)
