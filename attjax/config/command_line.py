"""What the commands share: arguments, and how they are parsed. It imports no JAX."""

import argparse
import functools
import re
import shlex
from pathlib import Path
from typing import Any, NoReturn

from attjax import errors
from attjax.config import fields, help_text, settings

Group = argparse._ActionsContainer
"""A parser, or a group of its flags."""
DEVICES = ("auto", "cpu", "gpu")


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, and exit status 2."""

    def __init__(self, **options: Any):
        options = {"prog": errors.running()} | options
        super().__init__(allow_abbrev=False, formatter_class=help_text.Formatter, **options)

    def error(self, message: str) -> NoReturn:
        """Print the message as one line and exit."""
        errors.fail(message)


def invocation(command: str) -> str:
    """How to start a program, as the one that runs was started.

    Example:
        >>> invocation("eval")
        'attjax eval'
    """
    is_file = errors.running().endswith(".py")
    return f"python {command}.py" if is_file else f"attjax {command}"


def examples(text: str) -> str:
    """The examples of a program's help, started as the one that runs was.

    Example:
        >>> examples("python train.py --resume")
        'attjax train --resume'
    """
    return re.sub(r"python (\w+)\.py", lambda found: invocation(found[1]), text)


def quoted(path: Path) -> str:
    """A path as a shell takes it, for advice to be copied."""
    return shlex.quote(str(path))


def path(text: str) -> Path:
    """An argparse type: a path, with ``~`` for a home also where the shell leaves it as it is."""
    if not text or "\0" in text:
        raise argparse.ArgumentTypeError(f"the path is {text!r}; it must have characters, no NUL")
    try:
        return Path(text).expanduser()
    except RuntimeError:
        raise argparse.ArgumentTypeError(f"there is no home for {text!r}; write it out") from None


def add_checkpoint(group: Group) -> None:
    """Add --checkpoint."""
    folder_help = "folder of the training run (default: ckpt)"
    group.add_argument(
        "--checkpoint", type=path, default=Path("ckpt"), metavar="FOLDER", help=folder_help
    )


def add_best(group: Group) -> None:
    """Add --best, which belongs beside --checkpoint."""
    best_help = "the checkpoint with the least terminal error in training, not the newest"
    group.add_argument("--best", action="store_true", help=best_help)


def add_seed_and_device(group: Group, seed_help: str) -> None:
    """Add --seed and --device."""
    add_number(group, "seed", int, None, f"{seed_help} (default: 0)", **fields.SEED)
    device_help = "where to compute (default: auto, a GPU if JAX finds one)"
    group.add_argument("--device", choices=DEVICES, default="auto", help=device_help)


def add_world(group: Group, default: str) -> None:
    """Add --world."""
    world_help = f"name or TOML file of the world that is flown in (default: {default})"
    group.add_argument("--world", metavar="NAME|FILE", help=world_help)


def add_keep_out(group: Group) -> None:
    """Add --keep-out."""
    keep_out_help = "TOML file of cones [[keep_out]] that axes keep out of, for --assured"
    group.add_argument("--keep-out", type=path, metavar="FILE", help=keep_out_help)


def add_frameskip(group: Group, meaning: str) -> None:
    """Add --frameskip, None where it is not given: one that suits the policy is chosen then."""
    table_2 = fields.TABLE_2
    default = f"{table_2} as in Table 2 if that was trained, else the trained one nearest to it"
    help = f"{meaning} (default: {default})"
    add_number(group, "frameskip", int, None, help, **fields.FRAMESKIP)


def warn_of_untrained(frameskip: int, trained: tuple[int, ...] | None) -> None:
    """Print a line on stderr for a frameskip that the policy was not trained at."""
    if trained and frameskip not in trained:
        rates = ", ".join(map(str, sorted(set(trained))))
        errors.warning_line(f"frameskip {frameskip} was not trained; the run trained {rates}")


def add_number(
    group: Group, name: str, kind: type, default: float | None, help: str, **details: Any
) -> None:
    """Add the flag of a number with details as in :func:`attjax.config.fields.setting`."""
    field = fields.single(name, kind, help, **details)
    help = help_text.meaning(field)
    group.add_argument(
        "--" + name,
        type=_parser_of(field),
        default=default,
        metavar={int: "N", float: "X"}[kind],
        help=help if default is None else f"{help} (default: {help_text.show(default)})",
    )


def add_settings(group: Group, name: str) -> None:
    """Add a flag for every setting of a group; those not given are left out of the namespace."""
    for field in settings.FIELDS.values():
        if field.metadata["group"] != name:
            continue
        flag = "--" + field.name.replace("_", "-")
        text = f"{help_text.meaning(field)} ({help_text.defaults(field.name)})"
        options: dict[str, Any] = {"default": argparse.SUPPRESS, "help": text}
        kind: Any = field.type
        if kind is bool:
            group.add_argument(flag, action=argparse.BooleanOptionalAction, **options)
        else:
            metavar = "|".join(field.metadata.get("choices", ())) or (
                {int: "N", float: "X"}.get(kind, "N,N,...")
            )
            group.add_argument(flag, type=_parser_of(field), metavar=metavar, **options)


def _parser_of(field):
    """An argparse type that parses and checks values of a setting."""
    return functools.partial(_parse, field)


def _parse(field, text):
    try:
        if field.type == tuple[int, ...]:
            value = tuple(int(part) for part in text.split(","))
        else:
            value = field.type(text)
    except ValueError:
        value = text
    try:
        return fields.check(field, value)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def overrides(arguments: argparse.Namespace) -> dict[str, Any]:
    """The settings that were given on the command line."""
    return {k: value for k, value in vars(arguments).items() if k in settings.FIELDS}
