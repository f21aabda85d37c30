"""What moves aboard a spacecraft, as a user describes it: reaction wheels, a flexible appendage."""

import dataclasses
import math
from typing import Annotated

from attjax.values import check_number
from attjax.world.distributions import Number, largest, least
from attjax.world.parts import Part, Range, check_direction
from attjax.world.telling import RK4_STEPS_A_SECOND


@dataclasses.dataclass(frozen=True, kw_only=True)
class Wheels(Part):
    """A balanced reaction wheel about each torque axis, all alike but for their speeds.

    Attributes:
        inertia: of one wheel about its axis, kg m². The spacecraft's includes it.
        most_torque: of its motor, N m; None: there is no limit.
        most_speed: rad/s; from it on the motor only slows the wheel down. None: there is no limit.
        coulomb_friction: against the wheel's turning, at any speed, N m.
        viscous_friction: N m s/rad.
        dead_band: N m; a smaller torque of the motor is none.
        start_speed: against the body, at the episode's start, rad/s, drawn for each wheel by
            itself.

    Raises:
        ValueError: a value is not as said, or friction would stop a wheel within an RK4 step.
    """

    inertia: Annotated[Number, Range(1e-9, 1e3)]
    most_torque: float | None = None
    most_speed: float | None = None
    coulomb_friction: Annotated[Number, Range(0, 1e3)] = 0.0
    viscous_friction: Annotated[Number, Range(0, 1e3)] = 0.0
    dead_band: Annotated[Number, Range(0, 1e3)] = 0.0
    start_speed: Annotated[Number, Range(-1e5, 1e5)] = 0.0

    def __post_init__(self):
        super().__post_init__()
        for name in ("most_torque", "most_speed"):
            if getattr(self, name) is not None:
                check_number(name, getattr(self, name), 1e-9, 1e6)
        most = RK4_STEPS_A_SECOND * least(self.inertia)
        if largest(self.viscous_friction) > most:
            raise ValueError(
                f"viscous_friction can be {largest(self.viscous_friction):g}; it must be at most "
                f"{most:g}, the least inertia over 1/{RK4_STEPS_A_SECOND} s"
            )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Flexible(Part):
    """One mode of a flexible appendage, or of liquid in a tank; it is at rest at first.

    Attributes:
        frequency: while the body is held still, Hz.
        damping: ratio, likewise.
        participation: how it pulls at the body's rotation, √kg m. Its square is a part of the
            spacecraft's inertia, kg m².
        axis: of the body, that it turns about; None: drawn uniformly.
    """

    frequency: Annotated[Number, Range(1e-3, RK4_STEPS_A_SECOND)]
    damping: Annotated[Number, Range(0, 1)] = 0.0
    participation: Annotated[Number, Range(0, 1e5)]
    axis: tuple[float, ...] | None = None

    def __post_init__(self):
        super().__post_init__()
        if self.axis is not None:
            check_direction("axis", self.axis)


def check_moving(
    wheels: Wheels | None, flexible: Flexible | None, axes: int, least_moment: float
) -> None:
    """Check that a spacecraft's inertia has room for what moves aboard.

    Args:
        wheels, flexible: None where there are none.
        axes: of torque, each with a wheel.
        least_moment: the least that a principal moment can be, kg m², with all of that in it.

    Raises:
        ValueError: they come to the least moment together, or the mode, which swings faster the
            more of the inertia is its own, would be too fast for RK4 steps of 1/240 s.
    """
    of_wheels = 0.0 if wheels is None else axes * largest(wheels.inertia)
    if of_wheels >= least_moment:
        raise ValueError(
            f"actuators.wheels.inertia of {axes} wheels comes to {of_wheels:g}; it must be below "
            f"the spacecraft's least moment, {least_moment:g}"
        )
    if flexible is None:
        return
    rest = least_moment - of_wheels
    own = largest(flexible.participation) ** 2
    if own >= rest:
        raise ValueError(
            f"disturbances.flexible.participation can be {math.sqrt(own):g}, whose square is "
            f"{own:g}; it must be below the spacecraft's least moment but for wheels, {rest:g}"
        )
    free = 1 - own / rest
    faster = max(1 / math.sqrt(free), 2 * largest(flexible.damping) / free)
    most = RK4_STEPS_A_SECOND / (2 * math.pi * faster)
    if largest(flexible.frequency) > most:
        raise ValueError(
            f"disturbances.flexible.frequency can be {largest(flexible.frequency):g}; at this "
            f"participation and damping it must be at most {most:.3g}, for RK4 steps of 1/240 s"
        )
