"""What moves aboard: balanced reaction wheels and one flexible mode, by components.

The inertia I that is given has all of it locked. With wheels of inertia J about unit vectors a and
a mode that pulls with δ, momentum is I ω + Σ J Ω a + δ η̇, and

    (I − Σ J a aᵀ − δ δᵀ) ω̇ = L − ω × (I ω + Σ J Ω a + δ η̇) − Σ u a + δ (2 ζ κ η̇ + κ² η),
    J (Ω̇ + a·ω̇) = u,    η̈ + 2 ζ κ η̇ + κ² η = −δ·ω̇.

The wheels' u is the motor's torque less friction (Schaub and Junkins, Analytical Mechanics of Space
Systems, section 4.5).
"""

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp

from attjax.dynamics import vectors
from attjax.dynamics.vectors import Vector
from attjax.spacecraft import INTEGRATION_STEP


class Motors(NamedTuple):
    """What the wheels' motors make of commanded torques, before it is known how fast they turn.

    Attributes:
        gains: of each.
        most_torque: N m; None: there is no limit.
        dead_band: a smaller torque is none, N m; None: there is no such.
    """

    gains: tuple[Any, ...]
    most_torque: Any
    dead_band: Any

    def torques(self, amounts: Any) -> Any:
        """(axes,) torques on the body, N m, of the (axes,) amounts that are commanded."""
        torques = jnp.stack(self.gains) * amounts
        if self.most_torque is not None:
            torques = jnp.clip(torques, -self.most_torque, self.most_torque)
        if self.dead_band is not None:
            torques = jnp.where(jnp.abs(torques) < self.dead_band, 0, torques)
        return torques


class Wheels(NamedTuple):
    """Reaction wheels during an agent step; their state is their speeds against the body, rad/s.

    Attributes:
        axes: unit vectors, body frame.
        inertia: of each about its axis, kg m².
        most_speed: from which on a motor only slows its wheel down, rad/s; None: there is none.
        coulomb: friction, N m; None: there is none.
        viscous: friction, N m s/rad; None: there is none.
        torques: on each wheel in this RK4 step, viscous friction left out, N m; () before
            :meth:`during`.
    """

    axes: tuple[Vector, ...]
    inertia: Any
    most_speed: Any
    coulomb: Any
    viscous: Any
    torques: tuple[Any, ...] = ()

    @property
    def coupling(self) -> tuple[Vector, ...]:
        """Vectors v, √kg m, of which each takes v vᵀ from the inertia that turns with the body."""
        return tuple(vectors.scaled(jnp.sqrt(self.inertia), axis) for axis in self.axes)

    def during(self, commanded: tuple, speeds: tuple) -> "Wheels":
        """The wheels in one RK4 step.

        Args:
            commanded: torque on the body along each axis, N m; the motor's is against it.
            speeds: at the step's beginning, rad/s.
        """
        torques = [self._torque(-torque, speed) for torque, speed in zip(commanded, speeds)]
        return self._replace(torques=tuple(torques))

    def _torque(self, motor, speed):
        """Of motor and Coulomb friction, which at most stops the wheel within the step."""
        if self.most_speed is not None:
            is_beyond = (jnp.abs(speed) >= self.most_speed) & (motor * speed >= 0)
            motor = jnp.where(is_beyond, 0, motor)
        if self.coulomb is None:
            return motor
        stopping = self.inertia * speed / INTEGRATION_STEP + motor
        return motor - jnp.clip(stopping, -self.coulomb, self.coulomb)

    def momentum(self, speeds: tuple) -> Vector:
        """Against the body, body frame, N m s."""
        return vectors.scaled(self.inertia, self.along_axes(speeds))

    def reaction(self, speeds: tuple) -> Vector:
        """Torque on the body, N m."""
        return vectors.scaled(-1, self.along_axes(self._all(speeds)))

    def along_axes(self, amounts: Any) -> Vector:
        """The sum of so much along each axis, body frame."""
        return functools.reduce(vectors.add, map(vectors.scaled, amounts, self.axes))

    def _all(self, speeds):
        if self.viscous is None:
            return self.torques
        return tuple(x - self.viscous * speed for x, speed in zip(self.torques, speeds))

    def rate(self, speeds: tuple, acceleration: Vector) -> tuple:
        """Rate of change of the speeds, rad/s², at the body's ω̇, rad/s²."""
        inverse = 1 / self.inertia
        return tuple(
            inverse * torque - vectors.dot(axis, acceleration)
            for torque, axis in zip(self._all(speeds), self.axes)
        )


class FlexibleMode(NamedTuple):
    """An appendage's mode; its state is the modal coordinate η, √kg m, and η̇, √kg m/s.

    Attributes:
        vector: δ, body frame, √kg m.
        stiffness: κ², 1/s², with κ the natural frequency while the body is held still.
        damping: 2 ζ κ, 1/s.
    """

    vector: Vector
    stiffness: Any
    damping: Any

    @property
    def coupling(self) -> tuple[Vector, ...]:
        """As of :class:`Wheels`."""
        return (self.vector,)

    def _force(self, state):
        return self.stiffness * state[0] + self.damping * state[1]

    def momentum(self, state: tuple) -> Vector:
        """As of :class:`Wheels`."""
        return vectors.scaled(state[1], self.vector)

    def reaction(self, state: tuple) -> Vector:
        """As of :class:`Wheels`."""
        return vectors.scaled(self._force(state), self.vector)

    def rate(self, state: tuple, acceleration: Vector) -> tuple:
        """Rate of change of η and η̇ at the body's ω̇, rad/s²."""
        return state[1], -self._force(state) - vectors.dot(self.vector, acceleration)
