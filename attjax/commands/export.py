"""Write a trained attitude controller for flight software: C99, ONNX or StableHLO."""

import argparse
import contextlib
import dataclasses
import importlib
from collections.abc import Sequence

from attjax import destinations, devices, errors
from attjax.commands import assured, evaluation_subject
from attjax.config import command_line, fields, toml
from attjax.export import c_names
from attjax.runs import folder as run_folder

FORMATS = {
    "c": "attjax.export.c",
    "onnx": "attjax.export.onnx",
    "stablehlo": "attjax.export.stablehlo",
}
NEEDED = {"onnx": "onnx", "stablehlo": "flatbuffers"}
USAGE = "%(prog)s --format FORMAT --out FOLDER [--checkpoint FOLDER] [FLAG ...]"
EXAMPLES = """\
examples:
  python export.py --checkpoint pretrained/precise --format c --out flight/
  python export.py --checkpoint ckpt/ --best --format onnx --out flight/
  python export.py --checkpoint ckpt/ --assured --format c --out flight/
"""


def parse_arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = command_line.Parser(
        usage=USAGE, description=__doc__, epilog=command_line.examples(EXAMPLES)
    )
    _add_what(parser.add_argument_group("what to export"))
    _add_assurance(parser.add_argument_group("run-time assurance"))
    _add_output(parser.add_argument_group("output"))
    return parser.parse_args(argv)


def _add_what(group):
    command_line.add_checkpoint(group)
    command_line.add_best(group)
    craft_help = "TOML file of what it is to fly, of a universal policy (default: as trained)"
    group.add_argument("--spacecraft", type=command_line.path, metavar="FILE", help=craft_help)
    command_line.add_frameskip(group, "control rate of the flight software, 240/(N + 1) Hz")
    command_line.add_seed_and_device(group, "seed of the slews that test vectors come from")


def _add_assurance(group):
    assured_help = (
        "the policy decides among actions alone after which every plant that the world states "
        "keeps the rate limit, the wheels' speeds and the cones of --keep-out"
    )
    group.add_argument("--assured", action="store_true", help=assured_help)
    command_line.add_world(group, "that of the policy's training")
    command_line.add_keep_out(group)


def _add_output(group):
    format_help = "c: C99 and C++, with a test program; onnx and stablehlo need the extra onnx"
    group.add_argument("--format", choices=FORMATS, required=True, help=format_help)
    out_help = "folder to write into"
    group.add_argument(
        "--out", type=command_line.path, metavar="FOLDER", required=True, help=out_help
    )
    prefix_help = (
        "what the names of the files begin with, and in C those of functions and macros: for two "
        f"rates in one program (default: {c_names.PREFIX})"
    )
    group.add_argument(
        "--prefix", type=_prefix, metavar="NAME", default=c_names.PREFIX, help=prefix_help
    )
    overwrite_help = "replace files that an export wrote before"
    group.add_argument("--overwrite", action="store_true", help=overwrite_help)


def _prefix(text):
    try:
        return c_names.check(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


@errors.program("export.py")
def main(argv: Sequence[str] | None = None) -> int:
    """Export a checkpoint; returns the exit status."""
    arguments = parse_arguments(argv)
    with errors.one_line_errors():
        assured.check(arguments, "world", "keep_out")
        if arguments.assured and arguments.format == "onnx":
            raise errors.UserError("--assured is for --format c and stablehlo, not onnx")
        devices.select_device(arguments.device)
        module = _module(arguments.format)
        flight = _flight_policy(arguments)
        names = [c_names.renamed(name, arguments.prefix) for name in module.FILES]
        _prepare(arguments.out, names, arguments.overwrite)
        command_line.warn_of_untrained(flight.env.frameskip, flight.origin.frameskips)
        with _exporting(arguments.checkpoint):
            contents = module.files(flight, arguments.seed or 0, arguments.prefix)
        with run_folder.writing(arguments.out):
            for name, content in contents.items():
                destinations.write(arguments.out / name, content)
        for name in contents:
            print(f"wrote {arguments.out / name}")
    return 0


def _module(name):
    try:
        return importlib.import_module(FORMATS[name])
    except ModuleNotFoundError as error:
        if error.name != NEEDED.get(name):
            raise
        needed = f"--format needs {error.name}: pip install 'attjax[onnx]'"
        raise errors.UserError(needed) from None


def _flight_policy(arguments):
    # Imported late: with them, --help and errors in the arguments would take seconds.
    from attjax.envs.attitude import AttitudeEnv
    from attjax.export import provenance
    from attjax.export.flight_policy import FlightPolicy
    from attjax.runs import build, checkpoint

    folder = arguments.checkpoint
    config = run_folder.read_config(folder)
    newest = checkpoint.latest(folder)
    update = checkpoint.best(folder) if arguments.best else newest
    policy, params = checkpoint.restore_network(folder, update)
    assert update is not None and newest is not None  # or there was nothing to restore
    if callable(policy.features) and arguments.format != "stablehlo":
        raise errors.UserError(
            f"the policy in {folder} sees {config.settings.network.features}, which --format "
            f"{arguments.format} does not know; stablehlo does"
        )
    frameskip = arguments.frameskip
    if frameskip is None:
        frameskip = fields.frameskip_to_judge(config.settings.task.frameskips)
    world = evaluation_subject.world(arguments, config)
    craft, rules = _spacecraft(arguments, config, world), build.rules(config.settings.task)
    with _exporting(folder):
        env = AttitudeEnv(frameskip, spacecraft=craft, **rules)
        flight = FlightPolicy(policy, params, env, provenance.of_run(config, update, newest))
    if not arguments.assured:
        return flight
    return dataclasses.replace(flight, guard=_guard(arguments, env, world))


def _guard(arguments, env, world):
    """What is let through of what a simulator's spacecraft does, in a world that it may fly in."""
    from attjax.config import run as run_config
    from attjax.export.assured import Guard

    with errors.one_line_errors(ValueError):
        run_config.check_world(world, env.spacecraft)
        within = dataclasses.replace(env, world=world)
    return Guard(assured.described(arguments, within), world)


def _spacecraft(arguments, config, world):
    """What the policy is to fly; of a universal one with its torques in the policy's order."""
    from attjax.control import torque_order

    is_universal, file = config.settings.network.is_universal, arguments.spacecraft
    if file is not None and not is_universal:
        raise errors.UserError(
            f"--spacecraft is for universal policies; the one in {arguments.checkpoint} flies "
            f"{config.spacecraft} alone"
        )
    craft = toml.read_spacecraft(file) if file else evaluation_subject.in_world(config, world)
    return torque_order.in_order(craft) if is_universal else craft


@contextlib.contextmanager
def _exporting(folder):
    try:
        yield
    except ValueError as error:
        raise errors.UserError(f"{folder} cannot be exported: {error}") from None


def _prepare(folder, names, overwrite):
    """Make the folder and see that it can be written to.

    Files of other names are left alone; those of an export only give way to ``overwrite``.
    """
    destinations.check_folder("--out", folder)
    present = [name for name in names if (folder / name).exists()]
    if present and not overwrite:
        raise errors.UserError(
            f"{folder} holds {present[0]} already: pass --overwrite to replace it, or another --out"
        )
