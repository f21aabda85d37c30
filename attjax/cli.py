"""What the commands share: arguments, one-line errors, paths, devices."""

import argparse
import contextlib
import functools
import os
import shlex
import sys
from pathlib import Path

from attjax import errors, fields, help_text, jax_setup, settings

DEVICES = ("auto", "cpu", "gpu")
TABLE_2 = 5
"""Frameskip of the paper's Table 2, 40 Hz."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line, and exit status 2."""

    def __init__(self, **options):
        super().__init__(allow_abbrev=False, formatter_class=help_text.Formatter, **options)

    def error(self, message: str):
        """Print the message as one line and exit."""
        errors.fail(self.prog, message)


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


def add_checkpoint(group) -> None:
    """Add --checkpoint."""
    folder_help = "folder of the training run (default: ckpt)"
    group.add_argument(
        "--checkpoint", type=path, default=Path("ckpt"), metavar="FOLDER", help=folder_help
    )


def add_best(group) -> None:
    """Add --best, which belongs beside --checkpoint."""
    best_help = "the checkpoint with the least terminal error in training, not the newest"
    group.add_argument("--best", action="store_true", help=best_help)


def add_seed_and_device(group, seed_help: str) -> None:
    """Add --seed and --device."""
    add_number(group, "seed", int, None, f"{seed_help} (default: 0)", **fields.SEED)
    device_help = "where to compute (default: auto, a GPU if JAX finds one)"
    group.add_argument("--device", choices=DEVICES, default="auto", help=device_help)


def add_frameskip(group, meaning: str) -> None:
    """Add --frameskip, None where it is not given: :func:`frameskip` then chooses."""
    default = f"{TABLE_2} as in Table 2 if that was trained, else the trained one nearest to it"
    help = f"{meaning} (default: {default})"
    add_number(group, "frameskip", int, None, help, **fields.FRAMESKIP)


def frameskip(given: int | None, trained: tuple[int, ...] | None) -> int:
    """The frameskip that was asked for, or else one that suits the controller.

    Args:
        given: what the user asked for, if anything.
        trained: those that the policy was trained at; None of a controller without training.

    Example:
        >>> frameskip(None, (7, 3, 20))  # the quicker of two as near
        3
    """
    if given is not None:
        return given
    return min(trained or [TABLE_2], key=lambda k: (abs(k - TABLE_2), k))


def warn_of_untrained(prog: str, frameskip: int, trained: tuple[int, ...] | None) -> None:
    """Print a line on stderr for a frameskip that the policy was not trained at."""
    if trained and frameskip not in trained:
        rates = ", ".join(map(str, sorted(set(trained))))
        print(
            f"{prog}: warning: frameskip {frameskip} was not trained; the run trained {rates}",
            file=sys.stderr,
        )


def add_number(group, name: str, kind: type, default, help: str, **details) -> None:
    """Add the flag of a number with details as in :func:`attjax.fields.setting`."""
    field = fields.single(name, kind, help, **details)
    help = help_text.meaning(field)
    group.add_argument(
        "--" + name,
        type=_parser_of(field),
        default=default,
        metavar={int: "N", float: "X"}[kind],
        help=help if default is None else f"{help} (default: {help_text.show(default)})",
    )


def add_settings(group, name: str) -> None:
    """Add a flag for every setting of a group; those not given are left out of the namespace."""
    for field in settings.FIELDS.values():
        if field.metadata["group"] != name:
            continue
        flag = "--" + field.name.replace("_", "-")
        text = f"{help_text.meaning(field)} ({help_text.defaults(field.name)})"
        options = {"default": argparse.SUPPRESS, "help": text}
        if field.type is bool:
            group.add_argument(flag, action=argparse.BooleanOptionalAction, **options)
        else:
            metavar = "|".join(field.metadata.get("choices", ())) or (
                {int: "N", float: "X"}.get(field.type, "N,N,...")
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


def overrides(arguments: argparse.Namespace) -> dict:
    """The settings that were given on the command line."""
    return {k: value for k, value in vars(arguments).items() if k in settings.FIELDS}


def select_device(name: str):
    """The JAX device for ``--device``, made the default, of JAX as the programs need it.

    On CPU each core becomes a device of its own, for training to share its work out to.

    Raises:
        errors.UserError: there is no such device, or JAX refuses a variable of the environment.
    """
    try:
        import jax
    except ValueError as error:
        named = [x for x in os.environ if x.startswith("JAX_") and x.lower() in str(error).lower()]
        values = jax_setup.set_variables(named)
        raise errors.UserError(f"JAX refuses its settings: {values or error}") from None
    if name == "cpu":
        jax.config.update("jax_platforms", "cpu")
        jax.config.update("jax_platform_name", "cpu")
    with contextlib.suppress(RuntimeError):  # called where JAX runs already, as it is set up there
        jax.config.update("jax_num_cpu_devices", available_cores())
    jax_setup.pin_settings()
    jax_setup.keep_compiled()
    try:
        device = jax.devices(None if name == "auto" else name)[0]
    except (RuntimeError, AssertionError):  # the latter: JAX_PLATFORMS=cuda, but no such plug-in
        found = jax_setup.set_variables(jax_setup.CHOOSING_DEVICES)
        if not found:
            found = f"it finds {jax.default_backend()}"
        raise errors.UserError(f"--device is {name}, and JAX finds none; {found}") from None
    jax.config.update("jax_default_device", device)
    return device


def available_cores() -> int:
    """The cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
