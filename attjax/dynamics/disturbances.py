"""Torques that nobody commands.

Where the spacecraft is in its orbit changes so slowly that it is taken in the middle of an agent
step; where it points to, in the middle of each RK4 step. A force f on a lever a, or a dipole a in a
field f, gives a × C f, with f in the target's frame and the attitude's matrix C. With all of them
in one matrix M = Σ a fᵀ, that is as cheap for many as for one.
"""

import functools
from typing import Any, NamedTuple, Protocol

import jax.numpy as jnp

from attjax.dynamics import vectors
from attjax.dynamics.vectors import Matrix, Vector

EARTH_RADIUS, EARTH_MU = 6.371e6, 3.986004418e14
"""m, and m³/s²."""

EARTH_DIPOLE, DIPOLE_TILT_DEG = 2.98e-5, 9.41
"""T above the equator at the mean radius, and degrees from the axis: IGRF-13 of 2020, degree 1."""

SOLAR_PRESSURE = 4.54e-6
"""N/m² at 1 au, on a surface that absorbs all."""

EARTH_RATE = 7.292115e-5
"""Of the Earth against the stars, rad/s."""


class Orbit(NamedTuple):
    """A circular orbit, seen from the target's frame, which does not turn.

    Attributes:
        node: unit vector from the Earth's centre to where the argument of latitude is 0.
        ahead: unit vector of the flight's direction there.
        rate: rad/s.
        start: argument of latitude at the episode's start, rad.
    """

    node: Vector
    ahead: Vector
    rate: Any
    start: Any

    def at(self, time: Any) -> tuple[Vector, Vector]:
        """Unit vectors from the Earth's centre to the spacecraft, and along its flight.

        Args:
            time: since the episode's start, s.
        """
        angle = self.start + self.rate * time
        cosine, sine = jnp.cos(angle), jnp.sin(angle)
        up = vectors.combined(cosine, self.node, sine, self.ahead)
        return up, vectors.combined(-sine, self.node, cosine, self.ahead)


class EarthDipole(NamedTuple):
    """The Earth's field, of a dipole that turns with it: B = B₀ (3 (d̂·r̂) r̂ − d̂).

    Attributes:
        strength: B₀, above its equator at the orbit's altitude, T.
        pole: what of the dipole's direction d̂ is along the Earth's axis, in the target's frame.
        first, second: the rest of it, at the angle 0 and a quarter of a turn later.
        start: this angle at the episode's start, rad.
    """

    strength: Any
    pole: Vector
    first: Vector
    second: Vector
    start: Any

    def field(self, up: Vector, time: Any) -> Vector:
        """B in the target's frame, T, where ``up`` leads from the Earth's centre."""
        angle = self.start + EARTH_RATE * time
        turned = vectors.combined(jnp.cos(angle), self.first, jnp.sin(angle), self.second)
        dipole = vectors.add(self.pole, turned)
        along = 3 * self.strength * vectors.dot(dipole, up)
        return vectors.combined(along, up, -self.strength, dipole)


class Disturbances(NamedTuple):
    """Of one spacecraft in one episode; what a world lacks is None.

    Attributes:
        gravity_gradient: rows of the inertia tensor, or the principal moments, kg m².
        dipole: its residual dipole, body frame, A m², and the Earth's.
        drag: lever from the centre of mass to that of pressure times the air's force, body, N m.
        radiation: the same of sunlight, and the direction to the Sun in the target's frame.
        constant: torque, body frame, N m.
        swinging: a torque's amplitude, body frame, N m, angular rate, rad/s, and phase, rad.
    """

    gravity_gradient: Matrix | Vector | None = None
    dipole: tuple[Vector, EarthDipole] | None = None
    drag: Vector | None = None
    radiation: tuple[Vector, Vector] | None = None
    constant: Vector | None = None
    swinging: tuple[Vector, Any, Any] | None = None

    def during(self, orbit: Orbit | None, time: Any) -> "Acting":
        """What acts in an agent step.

        Args:
            orbit: where it is; None in a world without one.
            time: of the agent step's middle, since the episode's start, s.
        """
        levers: list[tuple[Vector, Vector]] = []
        gravity = None
        if orbit is not None:
            up, along = orbit.at(time)
            if self.gravity_gradient is not None:
                gravity = vectors.scaled(3**0.5 * orbit.rate, up), self.gravity_gradient
            if self.dipole is not None:
                moment, earth = self.dipole
                levers.append((moment, earth.field(up, time)))
            if self.drag is not None:
                levers.append((self.drag, vectors.scaled(-1, along)))
        if self.radiation is not None:
            lever, sun = self.radiation
            levers.append((lever, vectors.scaled(-1, sun)))
        products = [vectors.outer(lever, force) for lever, force in levers]
        levers_sum = functools.reduce(vectors.add, products) if products else None
        return Acting(gravity, levers_sum, self.constant)


class Acting(NamedTuple):
    """What acts during one agent step.

    Attributes:
        gravity: √3 n r̂, rad/s, in the target's frame, and the inertia, kg m².
        levers: the matrix M = Σ a fᵀ, N m.
        constant: torque, body frame, N m.
    """

    gravity: tuple[Vector, Any] | None
    levers: Matrix | None
    constant: Vector | None

    def torque(self, quaternion: tuple) -> Vector | None:
        """The torque at an attitude, four scalars, body frame, N m; None where nothing acts."""
        found = [] if self.constant is None else [self.constant]
        if self.gravity is not None or self.levers is not None:
            attitude = vectors.attitude_matrix(quaternion)
        if self.gravity is not None:
            up = vectors.times(attitude, self.gravity[0])
            found.append(vectors.cross(up, vectors.times(self.gravity[1], up)))
        if self.levers is not None:
            found.append(vectors.sum_of_crosses(self.levers, attitude))
        return functools.reduce(vectors.add, found) if found else None


class OwnDisturbance(Protocol):
    """A disturbance of a user's own: a tree of scalars with this method.

    It is called in the compiled loop at each stage of an RK4 step: elementwise operations only.
    """

    def torque(self, quaternion: tuple, angular_velocity: Vector) -> Vector:
        """The torque, body frame, N m, at four and three scalars: attitude, and rate in rad/s."""
