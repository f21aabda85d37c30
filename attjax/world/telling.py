"""What tells a spacecraft's attitude and rate, as a user describes it: star tracker and gyro."""

import dataclasses
from typing import Annotated

from attjax.spacecraft import INTEGRATION_STEP
from attjax.values import check_number
from attjax.world.distributions import Number
from attjax.world.parts import Part, Range, check_direction

RK4_STEPS_A_SECOND = round(1 / INTEGRATION_STEP)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Gyro(Part):
    """A gyro of three axes, which tells the angular velocity at its own times.

    Attributes:
        rate_hz: how often; it must divide 240. None: at each decision.
        angle_random_walk_deg_per_root_h: white noise of the rate, °/√h. A sample of Δt has that
            over √Δt.
        bias_deg_per_h: at the start, about an axis that is drawn uniformly, °/h.
        bias_instability_deg_per_h: top of the Allan deviation that the bias's wandering makes, °/h.
        bias_correlation_time: of this wandering, s.
        scale_factor_ppm: error of each axis, drawn by itself, of either sign.
        misalignment_arcsec: angle of each axis from its own direction.
        rate_limit: rad/s; what is faster is told as this.
        resolution: rad/s; what is told is rounded to multiples of it.
    """

    rate_hz: float | None = None
    angle_random_walk_deg_per_root_h: Annotated[Number, Range(0, 1e6)] = 0.0
    bias_deg_per_h: Annotated[Number, Range(0, 1e7)] = 0.0
    bias_instability_deg_per_h: Annotated[Number, Range(0, 1e6)] = 0.0
    bias_correlation_time: float = 1000.0
    scale_factor_ppm: Annotated[Number, Range(-5e5, 5e5)] = 0.0
    misalignment_arcsec: Annotated[Number, Range(0, 1e5)] = 0.0
    rate_limit: float | None = None
    resolution: float = 0.0

    def __post_init__(self):
        super().__post_init__()
        check_rate(self.rate_hz)
        check_number("bias_correlation_time", self.bias_correlation_time, 1, 1e9)
        check_number("resolution", self.resolution, 0, 100)
        if self.rate_limit is not None:
            check_number("rate_limit", self.rate_limit, 1e-6, 1e6)


@dataclasses.dataclass(frozen=True, kw_only=True)
class StarTracker(Part):
    """A star tracker, which tells the attitude at its own times.

    Attributes:
        rate_hz: how often; it must divide 240. None: at each decision.
        cross_boresight_arcsec: standard deviation about each axis across the boresight.
        roll_arcsec: about the boresight.
        boresight: direction in the body frame.
        latency: from the moment that is seen to when it is told, s, rounded to RK4 steps of
            1/240 s; at most the time between two.
        most_rate: rad/s; while the spacecraft turns faster, nothing is told.
    """

    rate_hz: float | None = None
    cross_boresight_arcsec: Annotated[Number, Range(0, 1e5)] = 0.0
    roll_arcsec: Annotated[Number, Range(0, 1e5)] = 0.0
    boresight: tuple[float, ...] = (0, 0, 1)
    latency: float = 0.0
    most_rate: float | None = None

    def __post_init__(self):
        super().__post_init__()
        check_rate(self.rate_hz)
        check_direction("boresight", self.boresight)
        check_number("latency", self.latency, 0, 1e6)
        if self.latency and self.rate_hz is None:
            raise ValueError("latency is given, and no rate_hz")
        if self.rate_hz is not None and self.latency > 1 / self.rate_hz + 1e-9:
            raise ValueError(
                f"latency is {self.latency:g}; it must be at most the time between two, "
                f"{1 / self.rate_hz:g}"
            )
        if self.most_rate is not None:
            check_number("most_rate", self.most_rate, 1e-6, 100)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sensors(Part):
    """What is told of the spacecraft's motion; without a sensor, the truth at each decision."""

    gyro: Gyro | None = None
    star_tracker: StarTracker | None = None


def check_rate(rate_hz: object) -> None:
    """Check a sampling rate.

    Raises:
        ValueError: it is no number that divides 240.
    """
    if rate_hz is None:
        return
    check_number("rate_hz", rate_hz, 1e-3, RK4_STEPS_A_SECOND)
    steps = RK4_STEPS_A_SECOND / rate_hz  # type: ignore[operator]
    if abs(steps - round(steps)) > 1e-6 * steps:
        near = RK4_STEPS_A_SECOND / round(steps)
        raise ValueError(
            f"rate_hz is {rate_hz:g}; it must be {RK4_STEPS_A_SECOND} over an integer, as {near:g}"
        )
