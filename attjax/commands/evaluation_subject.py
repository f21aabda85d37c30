"""What ``eval.py`` is to judge: the run of the policy, the spacecraft, its world, the simulator."""

import argparse
import dataclasses
from collections.abc import Collection
from typing import TYPE_CHECKING

from attjax import errors
from attjax.config import run as run_config
from attjax.config import toml
from attjax.runs import folder as run_folder
from attjax.spacecraft import INTEGRATION_STEP, Spacecraft
from attjax.world import IDEAL, World, made_for

if TYPE_CHECKING:
    from attjax.envs.attitude import AttitudeEnv

POLICY = "policy"


def config(arguments: argparse.Namespace, names: Collection[str]) -> run_config.Config | None:
    """The policy's run; None where there is no policy.

    Args:
        arguments: of the command line.
        names: of the controllers.

    Raises:
        UserError: the checkpoint cannot be read, or a flag does not go with what is judged.
    """
    if arguments.frameskip is not None:
        _check_duration(arguments.duration, arguments.frameskip)
    run = run_folder.read_config(arguments.checkpoint) if POLICY in names else None
    if arguments.sampled and run is None:
        raise errors.UserError(f"--sampled is for a policy; {next(iter(names))} draws nothing")
    if run and arguments.actions not in (None, run.settings.task.actions):
        raise errors.UserError(
            f"--actions is {arguments.actions}; the policy in {arguments.checkpoint} was trained "
            f"with {run.settings.task.actions} ones, and what is judged beside it has the same"
        )
    return run


def complete(arguments: argparse.Namespace) -> None:
    """Fill in what depends on other flags.

    Raises:
        UserError: a flag does not go with another.
    """
    if arguments.keep_out and not arguments.assured:
        raise errors.UserError("--keep-out is for --assured")
    if arguments.episodes is None:
        arguments.episodes = 1000 if arguments.robustness else 5000
    if not arguments.robustness:
        return
    for flag in ("world", "bare", "sampled", "playback", "assured"):
        if getattr(arguments, flag):
            raise errors.UserError(f"--{flag} does not go with --robustness")


def world(arguments: argparse.Namespace, config: run_config.Config | None) -> World:
    """The world that was asked for, or that of the training.

    Raises:
        UserError: there is no such world.
    """
    if arguments.world is not None:
        return toml.read_world(arguments.world)
    return config.world if config else IDEAL


def spacecraft(
    arguments: argparse.Namespace, config: run_config.Config | None, world: World
) -> Spacecraft:
    """What flies, with the duration that was asked for.

    Without a file and a policy it is what the world was described for.

    Raises:
        UserError: its file cannot be read or describes none, or the duration is too short.
    """
    if arguments.spacecraft is not None:
        craft = toml.read_spacecraft(arguments.spacecraft)
    else:
        craft = config.spacecraft if config else made_for(world)
    if arguments.duration is not None:
        try:
            craft = dataclasses.replace(craft, duration=arguments.duration)
        except ValueError as error:
            raise errors.UserError(f"--duration {arguments.duration:g}: {error}") from None
    _check_duration(craft.duration, arguments.frameskip)
    return craft


def _check_duration(duration, frameskip):
    period = (frameskip + 1) * INTEGRATION_STEP
    if duration is not None and duration < period * (1 - 1e-6):
        raise errors.UserError(
            f"--duration is {duration} s; it must hold at least one agent step of {period:.4g} s"
        )


def env(
    arguments: argparse.Namespace,
    config: run_config.Config | None,
    spacecraft: Spacecraft,
    world: World,
) -> "AttitudeEnv":
    """The simulator that all controllers fly, by the rules of the policy's training.

    Raises:
        UserError: the spacecraft cannot fly in the world.
    """
    # Imported late: with it, --help and errors in the arguments would take seconds.
    from attjax.runs import build

    with errors.one_line_errors(ValueError):
        run_config.check_world(world, spacecraft)
    rules = {"actions": arguments.actions or "discrete"}
    if config:
        rules = build.rules(config.settings.task)
    return build.environment(arguments.frameskip, spacecraft, {"world": world, **rules})
