"""The body that torques turn: a rigid one, or one with parts that move aboard."""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import chex
import jax.numpy as jnp

from attjax.dynamics import rigid_body, vectors
from attjax.dynamics.equations import PrincipalTerms, TensorTerms
from attjax.dynamics.moving_parts import FlexibleMode, Wheels
from attjax.dynamics.vectors import Matrix, Vector


class RigidBody(NamedTuple):
    """A body aboard which nothing moves.

    Attributes:
        gyroscopic: the terms of −I⁻¹ (ω × Iω).
        inverse: I⁻¹, rows or diagonal, 1/(kg m²).
    """

    gyroscopic: PrincipalTerms | TensorTerms
    inverse: Matrix | Vector

    def during(self, commanded: Any, aboard: None) -> tuple[Vector | None, "RigidBody"]:
        """In one RK4 step: torque on it from outside, N m, and the body.

        Args:
            commanded: torque in this step, body frame, N m.
            aboard: as of :meth:`rate`, at the step's beginning.
        """
        del aboard
        return commanded, self

    def rate(
        self, torques: Sequence[Vector], angular_velocity: Vector, aboard: None
    ) -> tuple[Vector, None]:
        """ω̇, rad/s², and the rate of change of what moves aboard: nothing does.

        Args:
            torques: from outside, body frame, N m.
            angular_velocity: rad/s.
            aboard: state of what moves aboard.
        """
        torque = functools.reduce(vectors.add, torques)
        turning = self.gyroscopic.acceleration(angular_velocity)
        return vectors.add(turning, vectors.times(self.inverse, torque)), aboard


class BodyWithParts(NamedTuple):
    """A body with what moves aboard: the states of wheels and mode, None of what is not there.

    Attributes:
        inertia: I, rows or diagonal, kg m².
        inverse: rows of (I − Σ J a aᵀ − δ δᵀ)⁻¹, 1/(kg m²).
        wheels, flexible: None where there is none.
    """

    inertia: Matrix | Vector
    inverse: Matrix
    wheels: Wheels | None
    flexible: FlexibleMode | None

    def during(self, commanded: Any, aboard: tuple) -> tuple[Vector | None, "BodyWithParts"]:
        """As :meth:`RigidBody.during`; of wheels, the torque is not from outside."""
        if self.wheels is None:
            return commanded, self
        return None, self._replace(wheels=self.wheels.during(commanded, aboard[0]))

    def rate(
        self, torques: Sequence[Vector], angular_velocity: Vector, aboard: tuple
    ) -> tuple[Vector, tuple]:
        """As :meth:`RigidBody.rate`."""
        both = tuple(zip((self.wheels, self.flexible), aboard))
        moving = [(part, own) for part, own in both if part is not None]
        momentum = functools.reduce(
            vectors.add,
            [part.momentum(own) for part, own in moving],
            vectors.times(self.inertia, angular_velocity),
        )
        reactions = [part.reaction(own) for part, own in moving]
        turning = vectors.cross(momentum, angular_velocity)
        torque = functools.reduce(vectors.add, [*torques, *reactions], turning)
        acceleration = vectors.times(self.inverse, torque)
        rates = (None if part is None else part.rate(own, acceleration) for part, own in both)
        return acceleration, tuple(rates)


def body_of(
    inertia: chex.Array, wheels: Wheels | None = None, flexible: FlexibleMode | None = None
) -> RigidBody | BodyWithParts:
    """The body of (3,) principal moments or a (3, 3) tensor, kg m², with what moves aboard.

    Example:
        >>> body_of(jnp.array([1.0, 2.0, 4.0])).inverse[2].item()
        0.25
    """
    parts = [x for x in (wheels, flexible) if x is not None]
    if parts:
        turning = jnp.diag(inertia) if inertia.ndim == 1 else inertia
        for vector in (jnp.stack(x) for part in parts for x in part.coupling):
            turning = turning - vector[:, None] * vector
        rows = vectors.components(rigid_body.inverse(turning))
        return BodyWithParts(vectors.components(inertia), rows, wheels, flexible)
    if inertia.ndim == 1:
        return RigidBody(PrincipalTerms.of(inertia), vectors.components(1 / inertia))
    inverse = rigid_body.inverse(inertia)
    return RigidBody(TensorTerms.of(inertia, inverse), vectors.components(inverse))
