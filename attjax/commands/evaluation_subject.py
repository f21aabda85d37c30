"""What ``eval.py`` is to judge: a policy's run, a spacecraft in its world, what flies it."""

import argparse
import dataclasses
from collections.abc import Collection
from typing import TYPE_CHECKING

from attjax import errors
from attjax.commands import assured
from attjax.config import run as run_config
from attjax.config import toml
from attjax.runs import folder as run_folder
from attjax.spacecraft import INTEGRATION_STEP, LM50, Spacecraft
from attjax.world import IDEAL, World, made_for

if TYPE_CHECKING:
    from pathlib import Path

    from attjax.control.assured import Assurance
    from attjax.envs.attitude import AttitudeEnv
    from attjax.evaluation.flown import Controller

POLICY = "policy"
NOT_WITH = {
    "robustness": ("world", "bare", "keep_out", "sampled", "playback", "fleet"),
    "fleet": ("spacecraft", "world", "assured", "plot", "playback"),
    "bare": ("adaptive",),
}
"""Flags by the one that they do not go with."""


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
        UserError: flags do not go together.
    """
    assured.check(arguments, "keep_out")
    if arguments.episodes is None:
        arguments.episodes = 1000 if arguments.robustness else 5000
    for ladder, flags in NOT_WITH.items():
        for flag in flags if getattr(arguments, ladder) else ():
            if getattr(arguments, flag):
                shown = flag.replace("_", "-")
                raise errors.UserError(f"--{shown} does not go with --{ladder}")


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

    Without a file and a policy of one spacecraft it is what the world was described for.

    Raises:
        UserError: its file cannot be read or describes none, or the duration is too short.
    """
    if arguments.fleet:
        craft = dataclasses.replace(LM50, name="any spacecraft")
    elif arguments.spacecraft is not None:
        craft = toml.read_spacecraft(arguments.spacecraft)
    else:
        craft = in_world(config, world)
    if arguments.duration is not None:
        try:
            craft = dataclasses.replace(craft, duration=arguments.duration)
        except ValueError as error:
            raise errors.UserError(f"--duration {arguments.duration:g}: {error}") from None
    _check_duration(craft.duration, arguments.frameskip)
    return craft


def in_world(config: run_config.Config | None, world: World) -> Spacecraft:
    """What a run's policy flies in a world: its own spacecraft.

    A universal one flies what the world was described for, and so do those that have no run.
    """
    craft = made_for(world)
    if config and not (config.settings.network.is_universal and craft != LM50):
        return config.spacecraft
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

    if arguments.adaptive and world.wheels is not None:
        raise errors.UserError("--adaptive: a flight loop cannot adapt to reaction wheels yet")
    with errors.one_line_errors(ValueError):
        run_config.check_world(world, spacecraft)
    rules = {"actions": arguments.actions or "discrete"}
    if config:
        rules = build.rules(config.settings.task)
    return build.environment(arguments.frameskip, spacecraft, {"world": world, **rules})


def flown(
    name: str,
    arguments: argparse.Namespace,
    env: "AttitudeEnv",
    config: run_config.Config | None,
    assurance: "Assurance | None",
) -> "Controller":
    """A controller as it is to fly: in a flight loop and under assurance, or bare.

    Args:
        name: of the controller.
        arguments: of the command line.
        env: that it flies.
        config: of the policy's run.
        assurance: that stands after it.

    Raises:
        UserError: the checkpoint cannot be read, or its policy cannot fly the spacecraft.
    """
    from attjax.control.assured import assured as under_assurance
    from attjax.control.flight_loop import flight_loop

    controller, scores = _controller(name, arguments, env, config)
    if arguments.robustness:  # which flies each in every way
        return controller
    if arguments.bare:
        return controller if assurance is None else under_assurance(controller, assurance, scores)
    return flight_loop(controller, adapts=arguments.adaptive, assurance=assurance, scores=scores)


def companion(arguments: argparse.Namespace, config: run_config.Config | None) -> "Path | None":
    """Where the policy is that takes over from the one judged if an axis is found to be dead."""
    from attjax.runs import flight

    if config is None or not (arguments.adaptive and config.settings.network.is_universal):
        return None
    return flight.companion(arguments.checkpoint)


def _controller(name, arguments, env, config):
    """It, and the scores of its actions; None where it has none."""
    import jax

    from attjax.control import classical, torque_order
    from attjax.runs import flight

    if name != POLICY:
        return jax.tree_util.Partial(classical.CONTROLLERS[name]), None
    folder, trained_on = arguments.checkpoint, config.spacecraft
    is_universal = config.settings.network.is_universal
    if is_universal:
        with errors.one_line_errors(ValueError):
            torque_order.check_axes(env.spacecraft)
    is_tied = env.actions == "discrete" and not is_universal
    if is_tied and trained_on.num_actions != env.num_actions:
        raise errors.UserError(
            f"{arguments.spacecraft} has {env.num_actions} actions; the policy in {folder} "
            f"chooses among {trained_on.num_actions}"
        )
    policy, params = flight.network(folder, use_best=arguments.best, adapts=arguments.adaptive)
    if arguments.sampled:
        key = jax.random.key(arguments.seed or 0)
        return jax.tree_util.Partial(policy.draw, params, key), None
    act, scores = (jax.tree_util.Partial(x, params) for x in (policy.act, policy.scores))
    return act, scores
