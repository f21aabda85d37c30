"""What a spacecraft has aboard, and what of it is not as its controller believes."""

import dataclasses
from typing import Annotated

from attjax.spacecraft import INTEGRATION_STEP
from attjax.values import LARGEST, check_number, integer, shown
from attjax.world.distributions import Number, largest, least
from attjax.world.moving import Wheels
from attjax.world.parts import Part, Range


@dataclasses.dataclass(frozen=True, kw_only=True)
class Uncertainty(Part):
    """The inertia that flies, against the one that the controller believes and is judged by.

    Attributes:
        inertia_factor: of all three principal moments.
        moment_factor: of each moment, drawn by itself. A moment that would exceed the other two
            together is cut to their sum.
        axes_turned_deg: angle of the principal axes from those believed, about an axis that is
            drawn uniformly.
        change_factor: of the inertia from ``change_time`` on, as by what docks or is let go, whose
            rate is the same; nothing of it is known to the controller.
        change_time: s after the start.
    """

    inertia_factor: Annotated[Number, Range(0.05, 20)] = 1.0
    moment_factor: Annotated[Number, Range(0.05, 20)] = 1.0
    axes_turned_deg: Annotated[Number, Range(0, 180)] = 0.0
    change_factor: Annotated[Number, Range(0.05, 20)] = 1.0
    change_time: Annotated[Number, Range(0, 1e6)] = 0.0

    @property
    def least_factor(self) -> float:
        """The least that the least moment can be multiplied by; a cut leaves it as it is."""
        change = min(1.0, least(self.change_factor))
        return least(self.inertia_factor) * least(self.moment_factor) * change


@dataclasses.dataclass(frozen=True, kw_only=True)
class Actuators(Part):
    """What becomes of a commanded torque.

    Attributes:
        gain: of each torque axis, drawn by itself.
        misalignment_deg: angle of each torque axis from the one believed, in a direction that is
            drawn uniformly.
        minimum_impulse: N m s about an axis; a command for less does nothing.
        on_time_granularity: s. A level below the largest is that one for a shorter time, which is
            rounded to whole multiples.
        dead_levels: of torque, counted from 1 as the spacecraft's description has them, that do
            nothing.
        faulty_axes: torque axes, counted from 1, that ``fault_gain`` applies to.
        fault_gain: of faulty axes; 0 where they are dead.
        fault_time: s after the start from which on dead levels and faulty axes are so.
        delay: from command to torque, in RK4 steps of 1/240 s, rounded; one for each episode.
        delay_jitter: more of it, drawn for each command.
        wheels: reaction wheels that give the torque; None: it comes from outside, as of thrusters.
    """

    gain: Annotated[Number, Range(0, 10)] = 1.0
    misalignment_deg: Annotated[Number, Range(0, 90)] = 0.0
    minimum_impulse: float = 0.0
    on_time_granularity: float = 0.0
    dead_levels: tuple[int, ...] = ()
    faulty_axes: tuple[int, ...] = ()
    fault_gain: Annotated[Number, Range(0, 10)] = 0.0
    fault_time: Annotated[Number, Range(0, 1e6)] = 0.0
    delay: Annotated[Number, Range(0, 10_500)] = 0.0
    delay_jitter: Annotated[Number, Range(0, 10_500)] = 0.0
    wheels: Wheels | None = None

    def __post_init__(self):
        super().__post_init__()
        check_number("minimum_impulse", self.minimum_impulse, 0, LARGEST)
        check_number("on_time_granularity", self.on_time_granularity, 0, INTEGRATION_STEP)
        for name in ("dead_levels", "faulty_axes"):
            values = getattr(self, name)
            if not isinstance(values, tuple) or not all((integer(x) or 0) >= 1 for x in values):
                raise ValueError(f"{name} is {shown(values)}; it must be a list of integers from 1")

    @property
    def most_delay(self) -> float:
        """The latest that a command can come, RK4 steps."""
        return largest(self.delay) + largest(self.delay_jitter)
