"""What acts on a spacecraft from outside: its orbit, and the torques that disturb it."""

import dataclasses
from typing import Annotated

from attjax.values import check_truth
from attjax.world.distributions import Number
from attjax.world.moving import Flexible
from attjax.world.parts import Part, Range, check_direction


@dataclasses.dataclass(frozen=True, kw_only=True)
class Orbit(Part):
    """A circular orbit about the Earth. The target's attitude towards it is drawn uniformly.

    Attributes:
        altitude_km: above the mean radius of 6,371 km.
        inclination_deg: against the equator; what the dipole field is seen from.
    """

    altitude_km: Annotated[Number, Range(160, 1e6)]
    inclination_deg: Annotated[Number, Range(0, 180)] = 0.0


@dataclasses.dataclass(frozen=True, kw_only=True)
class Drag(Part):
    """Torque of the air's drag: a force against the flight, on a lever arm.

    Attributes:
        area: m², the same from all sides.
        coefficient: of drag.
        lever_arm: distance of the centre of pressure from that of mass, m, in a direction that is
            drawn uniformly.
        density: of the air, kg/m³.
    """

    area: Annotated[Number, Range(0, 1e4)]
    coefficient: Annotated[Number, Range(0, 10)] = 2.2
    lever_arm: Annotated[Number, Range(0, 100)]
    density: Annotated[Number, Range(0, 1e-6)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class RadiationPressure(Part):
    """Torque of sunlight, 4.54e-6 N/m², from a direction drawn uniformly; there is no eclipse.

    Attributes:
        area: m², the same from all sides.
        coefficient: 1 where all is absorbed, 2 where all is reflected.
        lever_arm: as of :class:`Drag`.
    """

    area: Annotated[Number, Range(0, 1e4)]
    coefficient: Annotated[Number, Range(0, 2)] = 1.5
    lever_arm: Annotated[Number, Range(0, 100)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sinusoid(Part):
    """A torque that swings, about an axis of the body and from a phase that are drawn uniformly.

    Attributes:
        torque: amplitude, N m.
        period: s.
    """

    torque: Annotated[Number, Range(0, 1e3)]
    period: Annotated[Number, Range(0.1, 1e6)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Disturbances(Part):
    """Torques that nobody commands.

    Attributes:
        gravity_gradient: whether the Earth pulls harder at what is nearer; needs the orbit.
        residual_dipole: A m², about an axis of the body that is drawn uniformly, in the field of a
            dipole that turns with the Earth; needs the orbit.
        drag: needs the orbit.
        radiation_pressure: of the Sun.
        constant_torque: N m, about ``constant_axis`` of the body, or one that is drawn uniformly.
        constant_axis: its direction.
        sinusoid: a torque that swings.
        flexible: an appendage that swings.
    """

    gravity_gradient: bool = False
    residual_dipole: Annotated[Number, Range(0, 1e4)] = 0.0
    drag: Drag | None = None
    radiation_pressure: RadiationPressure | None = None
    constant_torque: Annotated[Number, Range(0, 1e3)] = 0.0
    constant_axis: tuple[float, ...] | None = None
    sinusoid: Sinusoid | None = None
    flexible: Flexible | None = None

    def __post_init__(self):
        super().__post_init__()
        check_truth("gravity_gradient", self.gravity_gradient)
        if self.constant_axis is not None:
            check_direction("constant_axis", self.constant_axis)

    @property
    def in_orbit(self) -> list[str]:
        """Names of those that need the orbit."""
        needing = "gravity_gradient", "residual_dipole", "drag"
        return [name for name in needing if getattr(self, name) not in (None, False, 0.0)]
