"""The equations of motion of a rigid body: Euler's (Eq. 6) and the quaternion kinematics (Eq. 9).

They are written for scalars, one a component, in named tuples: JAX takes these for trees, so that
nothing but the compiled loop knows in which order the components stand. What else accelerates the
spacecraft is one more term in :meth:`EquationsOfMotion.rate`, and what else changes with time one
more component of the state.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
import numpy as np

from attjax.dynamics import quaternion as quaternions
from attjax.dynamics import rigid_body
from attjax.dynamics.numerics import matmul
from attjax.dynamics.vectors import Vector, add

Products = tuple[chex.Array, chex.Array, chex.Array, chex.Array, chex.Array, chex.Array]

PRODUCTS = ((1, 2), (2, 0), (0, 1), (0, 0), (1, 1), (2, 2))
"""The products ωⱼ ωₖ of which the gyroscopic acceleration of a full tensor is made."""

_LEVI_CIVITA = np.cross(np.eye(3)[:, None], np.eye(3)).transpose(2, 0, 1)


class RigidState(NamedTuple):
    """Attitude and rate by components; also their change, and their rate of change.

    Attributes:
        quaternion: four scalars, scalar part last.
        angular_velocity: three scalars, body frame, rad/s.
    """

    quaternion: tuple[chex.Array, chex.Array, chex.Array, chex.Array]
    angular_velocity: Vector

    @classmethod
    def of(cls, quaternion: chex.Array, angular_velocity: chex.Array) -> "RigidState":
        """The components of a (4,) quaternion and a (3,) angular velocity, rad/s."""
        return cls(quaternion=tuple(quaternion), angular_velocity=tuple(angular_velocity))

    def vectors(self) -> tuple[chex.Array, chex.Array]:
        """The quaternion (4,) and the angular velocity (3,), rad/s."""
        return jnp.stack(self.quaternion), jnp.stack(self.angular_velocity)


class PrincipalTerms(NamedTuple):
    """Gyroscopic terms of a body in its principal axes.

    Attributes:
        factors: (Iⱼ − Iₖ)/Iᵢ of each axis i, the factor of ωⱼ ωₖ.
    """

    factors: Vector

    @classmethod
    def of(cls, moments: chex.Array) -> "PrincipalTerms":
        """The terms of (3,) principal moments, kg m²."""
        i1, i2, i3 = moments
        return cls(factors=((i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3))

    def acceleration(self, angular_velocity: Vector) -> Vector:
        """−I⁻¹ (ω × Iω), rad/s², of ω in rad/s."""
        w1, w2, w3 = angular_velocity
        a, b, c = self.factors
        return a * (w2 * w3), b * (w3 * w1), c * (w1 * w2)


class TensorTerms(NamedTuple):
    """Gyroscopic terms of a body in any axes.

    Attributes:
        first, second, third: of this axis, the factors of all the products in PRODUCTS.
    """

    first: Products
    second: Products
    third: Products

    @classmethod
    def of(cls, inertia: chex.Array, inverse: chex.Array) -> "TensorTerms":
        """The terms of a (3, 3) inertia, kg m², and its inverse."""
        cross = jnp.array(_LEVI_CIVITA, inertia.dtype)
        factors = -jnp.einsum("il,ljm,mk->ijk", inverse, cross, inertia, precision="highest")
        factors = factors + factors.swapaxes(1, 2)
        first, second, third = (
            tuple(axis[j, k] / (2 if j == k else 1) for j, k in PRODUCTS) for axis in factors
        )
        return cls(first=first, second=second, third=third)

    def acceleration(self, angular_velocity: Vector) -> Vector:
        """−I⁻¹ (ω × Iω), rad/s², of ω in rad/s."""
        products = [angular_velocity[j] * angular_velocity[k] for j, k in PRODUCTS]

        def along(factors):
            return sum(factor * product for factor, product in zip(factors, products))

        return along(self.first), along(self.second), along(self.third)


@jax.tree_util.register_static
@dataclasses.dataclass(frozen=True)
class Kinematics:
    """Eq. 9. It is known when it is compiled, and no number of the trees that hold it.

    Attributes:
        factor: of Ω(ω) q: ½, or 1, as the authors' public code has it.
    """

    factor: float = 0.5

    def rate(self, quaternion: Sequence[Any], angular_velocity: Sequence[Any]) -> tuple:
        """The four components of q̇, 1/s, of those of q and of ω, rad/s."""
        return quaternions.derivative(quaternion, angular_velocity, self.factor)


class EquationsOfMotion(NamedTuple):
    """Eq. 6, solved for ω̇, and Eq. 9, with all that stays the same over an RK4 step.

    Attributes:
        torque: I⁻¹ M of the commanded torque, rad/s²; None while none is on.
        gyroscopic: the terms of −I⁻¹ (ω × Iω).
        kinematics: of the attitude.
        pushing: I⁻¹ d of a torque d that always acts, rad/s²; None: there is none.
    """

    torque: Vector | None
    gyroscopic: PrincipalTerms | TensorTerms
    kinematics: Kinematics
    pushing: Vector | None = None

    @classmethod
    def of(
        cls, inertia: chex.Array, torque: chex.Array, kinematic_factor: float = 0.5
    ) -> "EquationsOfMotion":
        """The equations of an inertia (3,) or (3, 3), kg m², under a torque (3,), N m."""
        kinematics = Kinematics(kinematic_factor)
        gyroscopic: PrincipalTerms | TensorTerms
        if inertia.ndim == 1:
            gyroscopic = PrincipalTerms.of(inertia)
            acceleration = torque / inertia
        else:
            inverse = rigid_body.inverse(inertia)
            gyroscopic = TensorTerms.of(inertia, inverse)
            acceleration = matmul(inverse, torque)
        return cls(torque=tuple(acceleration), gyroscopic=gyroscopic, kinematics=kinematics)

    def coasting(self) -> "EquationsOfMotion":
        """The same with the commanded torque off."""
        return self._replace(torque=None)

    @property
    def steps_together(self) -> int:
        """RK4 steps in one loop over a batch, or in one kernel: three such are the paper's 21."""
        return 7

    @property
    def is_timed(self) -> bool:
        """Whether they are told which RK4 step of an agent step it is, counted from 0."""
        return False

    def during(self, number: Any, state: RigidState) -> "EquationsOfMotion":
        """The equations of that RK4 step, which begins with this state: here always the same."""
        del number, state
        return self

    def after(self, number: Any, change: RigidState) -> RigidState:
        """What is kept of the change from the agent step's start to that RK4 step's end: all."""
        del number
        return change

    def rate(self, state: RigidState) -> RigidState:
        """Rate of change of the state."""
        acceleration = self.gyroscopic.acceleration(state.angular_velocity)
        if self.torque is not None:
            acceleration = add(acceleration, self.torque)
        if self.pushing is not None:
            acceleration = add(acceleration, self.pushing)
        return RigidState(
            quaternion=self.kinematics.rate(state.quaternion, state.angular_velocity),
            angular_velocity=acceleration,
        )
