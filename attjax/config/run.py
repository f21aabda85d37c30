"""What a training run is started with, and what it may be continued with."""

import dataclasses
import operator
import os
from pathlib import Path
from typing import Any

from attjax.config.presets import PRECISE, PRESETS
from attjax.config.settings import Settings
from attjax.errors import UserError, UserValueError
from attjax.spacecraft import LM50, Spacecraft
from attjax.world import IDEAL, World, check_moving

DEFAULT_PRESET = "precise"
CUSTOM = "custom"
"""The preset's name in a run whose settings were all given."""

FOREIGN = {"td3": "TD3"}
"""Other learners, by the preset's name in a run that keeps a policy of theirs.

Of its settings only task and network are the policy's; those of PPO say nothing.
"""


NETWORKS = "features", "hidden_sizes", "initial_weights", "actions", "observes_quaternion_rate"
"""Settings that say what networks are, and what their inputs and outputs mean."""


@dataclasses.dataclass(frozen=True)
class Origin:
    """The checkpoint whose networks a run began with.

    Attributes:
        folder: of its run, absolute.
        run: the id of that run; None of an earlier version's.
        update: that it was saved at.
        has_value: whether it has a value network; otherwise that began anew.

    Raises:
        ValueError: one of them is of another type.
    """

    folder: str
    run: str | None
    update: int
    has_value: bool

    def __post_init__(self):
        kinds = {"folder": str, "run": str | None, "update": int, "has_value": bool}
        wrong = {x: y for x, y in vars(self).items() if not isinstance(y, kinds[x])}
        if wrong:
            raise ValueError(f"resumed_from has {wrong!r:.80}")


@dataclasses.dataclass(frozen=True)
class Config:
    """What a run was started with.

    Raises:
        ValueError: an agent step, or a delay, takes longer than the spacecraft's episode.
    """

    preset: str
    seed: int
    settings: Settings
    spacecraft: Spacecraft = LM50
    world: World = IDEAL
    resumed_from: Origin | None = None

    def __post_init__(self):
        object.__setattr__(self, "seed", operator.index(self.seed))
        longest = max(self.settings.task.frameskips)
        if longest > self.spacecraft.most_frameskip:
            raise ValueError(
                f"frameskips holds {longest}; in {self.spacecraft.duration} s, the duration of an "
                f"episode, it must be at most {self.spacecraft.most_frameskip}"
            )
        check_world(self.world, self.spacecraft)


def check_world(world: World, spacecraft: Spacecraft) -> None:
    """Check that a spacecraft can fly in a world.

    Raises:
        ValueError: its episode is shorter than a delay, it lacks a level or an axis, its inertia
            is not enough for what moves aboard, or the world has what no file can describe.
    """
    if world.own_parts:
        raise ValueError(f"a world with {world.own_parts[0]} cannot be kept with a run")
    factor = 1.0 if world.uncertainty is None else world.uncertainty.least_factor
    axes = max(3, len(spacecraft.torque_axes))  # continuous actions have the body's
    check_moving(world.wheels, world.flexible, axes, factor * spacecraft.least_moment)
    actuators = world.actuators
    if actuators is None:
        return
    most = spacecraft.most_frameskip
    if actuators.most_delay > most:
        raise ValueError(
            f"actuators.delay and delay_jitter come to {actuators.most_delay:g}; in an episode of "
            f"{spacecraft.duration:g} s they must be at most {most}"
        )
    for name, of in (("dead_levels", "torque_levels"), ("faulty_axes", "torque_axes")):
        count = len(getattr(spacecraft, of))
        if any(number > count for number in getattr(actuators, name)):
            raise ValueError(
                f"actuators.{name} holds {max(getattr(actuators, name))}; "
                f"{spacecraft} has {count} {of}"
            )


def new(
    preset: str = DEFAULT_PRESET,
    seed: int = 0,
    spacecraft: Spacecraft = LM50,
    world: World | str = IDEAL,
    **values: Any,
) -> Config:
    """The configuration of a new run: a preset, but for settings given by name.

    The world may be one of the named ones.

    Raises:
        ValueError: the preset is unknown, or something is not as :class:`Settings` says.

    Example:
        >>> new("paper", num_envs=64).settings.ppo.num_envs
        64
    """
    if preset not in (*PRESETS, CUSTOM):
        raise ValueError(f"preset is {preset!r}; it must be one of {', '.join(PRESETS)}")
    settings = PRESETS.get(preset, PRECISE).replace(**values)
    return Config(preset, seed, settings, spacecraft, World.of(world))


def continued(old: Config, origin: Origin, given: dict) -> Config:
    """The configuration of a new run that begins with the networks of another.

    Args:
        old: of the other run.
        origin: the checkpoint.
        given: preset, seed, spacecraft, world, settings, by name, where they are not the other
            run's; the seed is 0 where it is not given.

    Raises:
        UserValueError: the networks would be others, or the run is no PPO's.
        ValueError: as :func:`new`.
    """
    if old.preset in FOREIGN:
        name = FOREIGN[old.preset]
        raise UserValueError(f"--resume-from takes runs of PPO; {origin.folder} is one of {name}")
    kept = {"spacecraft": old.spacecraft, "world": old.world}
    if "preset" not in given:
        kept |= {"preset": CUSTOM, **old.settings.flat}
    preset = given.get("preset", old.preset)
    config = dataclasses.replace(new(**kept | given), preset=preset, resumed_from=origin)
    ours, theirs = config.settings.flat, old.settings.flat
    differing = [f"{x} is {ours[x]}, not {theirs[x]}" for x in NETWORKS if ours[x] != theirs[x]]
    count, needed = config.spacecraft.num_actions, old.spacecraft.num_actions
    is_of_table = ours["actions"] == "discrete" and ours["features"] != "universal"
    if is_of_table and count != needed:
        differing.append(f"{config.spacecraft} has {count} actions, not {needed}")
    if differing:
        listed = "; ".join(differing)
        raise UserValueError(f"--resume-from keeps the networks of {origin.folder}: {listed}")
    return config


def real_path(folder: str | Path) -> str:
    """The folder that a run is to begin from: absolute, without links, with ``~`` for a home.

    Raises:
        UserValueError: no folder can have that name.
    """
    try:
        return os.path.realpath(Path(folder).expanduser())
    except (ValueError, RuntimeError) as error:
        raise UserValueError(f"resume_from is {str(folder)!r}: {error}") from None


def lengthened(config: Config, given: dict) -> Config:
    """What a run was started with, with a larger total of steps if one is given.

    Args:
        config: of the run.
        given: preset, seed, spacecraft, world, settings, and the folder that it began from, by
            name, that it is to be continued with.

    Raises:
        UserError: one of them is not the run's, the total is smaller, or the run is no PPO's.
    """
    if config.preset in FOREIGN:
        raise UserError(
            f"--resume goes on with runs of PPO; this one is of {FOREIGN[config.preset]}"
        )
    before = config.settings.ppo.total_steps
    total = given.get("total_steps", before)
    origin = config.resumed_from and config.resumed_from.folder
    run = vars(config) | config.settings.flat | {"total_steps": total, "resume_from": origin}
    for name, read in (("world", World.of), ("resume_from", real_path)):
        if name in given:
            given = given | {name: read(given[name])}
    differing = [name for name, value in given.items() if run[name] != value]
    if differing:
        listed = ", ".join(f"{name} ({run[name]})" for name in differing)
        raise UserError(f"--resume keeps the run's settings; leave out {listed}")
    if total < before:
        raise UserError(
            f"--total-steps is {total}; to resume, it must be at least the run's {before}"
        )
    return dataclasses.replace(config, settings=config.settings.replace(total_steps=total))
