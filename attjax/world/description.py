"""The whole description of a world: from Python, from a file, or by name."""

import dataclasses
import functools
from importlib import resources
from pathlib import Path
from typing import Any, Self

from attjax.spacecraft import LM50, Spacecraft, read_toml
from attjax.world.aboard import Actuators, Uncertainty
from attjax.world.moving import Flexible, Wheels
from attjax.world.outside import Disturbances, Orbit
from attjax.world.parts import Part
from attjax.world.telling import Sensors

OWN = "own_disturbances", "own_actuators", "own_sensors"


@dataclasses.dataclass(frozen=True, kw_only=True)
class World(Part):
    """Sensors, actuators, disturbances and what is uncertain; a part that is None is ideal.

    Attributes:
        name: for people; one that is not ideal is not called so, but "unnamed".
        orbit, sensors, actuators, disturbances, uncertainty: its parts.
        own_disturbances, own_actuators, own_sensors: of a user's own, in Python only: hashable,
            with a method ``drawn(draws)`` that makes for an episode, of its
            :class:`attjax.dynamics.draws.Draws`, an
            :class:`attjax.dynamics.disturbances.OwnDisturbance`, an
            :class:`attjax.dynamics.actuators.OwnActuator` or an
            :class:`attjax.dynamics.sensing.OwnSensor`.

    Raises:
        ValueError: a value is not as its part says, or a disturbance needs an orbit.

    Example:
        >>> from attjax.world import Actuators, Uniform, World
        >>> World(name="late", actuators=Actuators(delay=Uniform(2, 6))).is_ideal
        False
    """

    name: str = "ideal"
    orbit: Orbit | None = None
    sensors: Sensors | None = None
    actuators: Actuators | None = None
    disturbances: Disturbances | None = None
    uncertainty: Uncertainty | None = None
    own_disturbances: tuple[Any, ...] = ()
    own_actuators: tuple[Any, ...] = ()
    own_sensors: tuple[Any, ...] = ()

    def __post_init__(self):
        super().__post_init__()
        if not isinstance(self.name, str) or not self.name.isprintable() or not self.name:
            raise ValueError(f"name is {self.name!r}; it must be a line of text")
        if self.name == "ideal" and not self.is_ideal:
            object.__setattr__(self, "name", "unnamed")
        needing = self.disturbances.in_orbit if self.disturbances else []
        if needing and self.orbit is None:
            raise ValueError(f"disturbances.{needing[0]} needs an orbit")

    def __str__(self):
        return self.name

    @property
    def is_ideal(self) -> bool:
        """Whether nothing in it differs from the paper's perfect world."""
        parts = self.sensors, self.actuators, self.disturbances, self.uncertainty
        return not self.own_parts and all(x is None or x == type(x)() for x in parts)

    @property
    def own_parts(self) -> list[str]:
        """Names of what is a user's own."""
        return [name for name in OWN if getattr(self, name)]

    @property
    def wheels(self) -> Wheels | None:
        """Its reaction wheels; None where it has none."""
        return None if self.actuators is None else self.actuators.wheels

    @property
    def flexible(self) -> Flexible | None:
        """Its flexible appendage; None where it has none."""
        return None if self.disturbances is None else self.disturbances.flexible

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read a TOML file; without a name, the world has the file's.

        Raises:
            OSError: it cannot be read.
            ValueError: it is no TOML, or something in it is not as said.
        """
        return cls.from_lists({"name": Path(path).stem} | read_toml(path))

    @classmethod
    def from_lists(cls, values: Any) -> Self:
        """A world from what TOML or JSON make of its tables.

        Raises:
            ValueError: a name is unknown or missing, or a value is not as said.
        """
        own = [name for name in OWN if isinstance(values, dict) and values.get(name)]
        if own:
            raise ValueError(f"{own[0]} can be given in Python only")
        try:
            return cls.from_table(values, "world")
        except ValueError as error:
            raise ValueError(str(error).removeprefix("world.")) from None

    @classmethod
    def of(cls, world: "World | str") -> "World":
        """The world itself, or that of a name.

        Raises:
            ValueError: there is none of that name.
        """
        return cls.named(world) if isinstance(world, str) else world

    @classmethod
    def named(cls, name: str) -> "World":
        """One of the named worlds.

        Raises:
            ValueError: there is none of that name.
        """
        if name == IDEAL.name:
            return IDEAL
        if name not in names():
            raise ValueError(f"world is {name!r}; it must be one of {', '.join(names())}")
        return cls.from_toml(Path(str(resources.files("attjax.world") / f"{name}.toml")))


IDEAL = World()
"""The paper's: the truth is told, torques are as commanded, and nothing else acts."""


@functools.cache
def names() -> tuple[str, ...]:
    """Names of the named worlds."""
    found = (Path(str(x)) for x in resources.files("attjax.world").iterdir())
    return (IDEAL.name, *sorted(x.stem for x in found if x.suffix == ".toml"))


def made_for(world: World) -> Spacecraft:
    """The spacecraft that a named world was described for; LM50 for all others.

    Example:
        >>> made_for(World.named("cubesat-6u")).name, made_for(IDEAL).name
        ('6U CubeSat', 'LM50')
    """
    path = Path(str(resources.files("attjax.world") / "spacecraft" / f"{world.name}.toml"))
    is_named = world.name in names() and path.exists() and world == World.named(world.name)
    return Spacecraft.from_toml(path) if is_named else LM50
