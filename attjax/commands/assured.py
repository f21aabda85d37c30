"""``eval.py --assured``: controllers under run-time assurance."""

import argparse
import math
from typing import TYPE_CHECKING, Any

from attjax import errors
from attjax.config import toml

if TYPE_CHECKING:
    from attjax.control.assured import Assurance
    from attjax.envs.attitude import AttitudeEnv

LITTLE = 0.1
"""Share of the sphere, left to a body axis by its cone and the reserve, below which is a warning.
"""


def check(arguments: argparse.Namespace, *flags: str) -> None:
    """Check that none of these flags, which are for --assured, is given without it.

    Raises:
        UserError: one is.
    """
    for flag in flags:
        if getattr(arguments, flag) is not None and not arguments.assured:
            raise errors.UserError(f"--{flag.replace('_', '-')} is for --assured")


def asked_for(arguments: argparse.Namespace, env: "AttitudeEnv") -> "Assurance | None":
    """The assurance that was asked for; None where there is none.

    Args:
        arguments: of the command line.
        env: what flies.

    Raises:
        UserError: its cones cannot be read.
    """
    return described(arguments, env) if arguments.assured else None


def described(arguments: argparse.Namespace, env: "AttitudeEnv") -> "Assurance":
    """As :func:`asked_for`, whether or not it was."""
    from attjax.control import assured

    keep_out = toml.read_keep_out(arguments.keep_out) if arguments.keep_out else ()
    with errors.one_line_errors(ValueError):
        assurance = assured.assurance(env, keep_out)
    if not assurance.is_certain:
        errors.warning_line(
            "nothing is proved of this world: what acts on the spacecraft in it can be stronger "
            "than the torques that are certain"
        )
    _warn_of_wide_cones(assurance)
    return assurance


def _warn_of_wide_cones(assurance):
    """Where cones and their reserve leave next to nothing of the sphere, it does but brake."""
    if assurance.cones is None:
        return
    reserve, widest = float(assurance.reserve), float(max(assurance.cones.half_angles))
    left = (1 + math.cos(min(reserve + widest, math.pi))) / 2
    if left < LITTLE:
        errors.warning_line(
            f"the spacecraft will hardly turn: by what the world states, once braked it may still "
            f"drift by {math.degrees(reserve):.0f}° in a flight, and it keeps that far from a cone"
        )


def told(assurance: "Assurance | None") -> dict[str, Any]:
    """What the results say of it."""
    if assurance is None:
        return {}
    cones = 0 if assurance.cones is None else len(assurance.cones.axes)
    return {"assured": bool(assurance.is_certain), "keep_out": cones}


def line(assurance: "Assurance") -> str:
    """What the report says of it."""
    from attjax.control import keep_out

    limits = keep_out.limits(assurance.cones)
    how = "for every plant that the world states" if assurance.is_certain else "as well as it can"
    return f"assured: {limits}, {how}"
