"""Cones that axes of the body keep out of, as numbers."""

from collections.abc import Sequence

import chex
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax.dynamics import numerics
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics.numerics import matmul, square_root
from attjax.envs.context import Context
from attjax.world.keep_out import KeepOut


class Cones(struct.PyTreeNode):
    """Keep-out cones.

    Attributes:
        axes: (cones, 3) unit vectors, body frame.
        directions: (cones, 3) unit vectors, the target's frame.
        half_angles: (cones,) rad.
        per_rate: what the attitude turns by, per ∫ω dt: 1 by Eq. 9.
    """

    axes: chex.Array
    directions: chex.Array
    half_angles: chex.Array
    per_rate: chex.Array

    def seen(self, quaternion: chex.Array) -> chex.Array:
        """(cones, 3) unit vectors of the cones' middles, body frame, at an attitude (4,)."""
        turn = quaternions.rotation_matrix(quaternion)
        return matmul(self.directions, turn)

    def clearance(self, quaternion: chex.Array) -> chex.Array:
        """(cones,) angles from the cones to their axes, rad; negative within.

        Args:
            quaternion: (4,) which turns the body's components of a vector into the target's.
        """
        seen = self.seen(quaternion)
        sine = square_root(jnp.sum(jnp.cross(self.axes, seen) ** 2, axis=-1))
        cosine = jnp.sum(self.axes * seen, axis=-1)
        return numerics.polar_angle(sine, cosine) - self.half_angles


def cones_of(keep_out: Sequence[KeepOut], context: Context) -> Cones | None:
    """Cones as they are described; None where there are none.

    Example:
        >>> from attjax import AttitudeEnv
        >>> env = AttitudeEnv(frameskip=5)
        >>> sun = KeepOut(axis=(0, 0, 2), direction=(1, 0, 0), half_angle_deg=30)
        >>> cones = cones_of([sun], env.context(env.default_params))
        >>> round(jnp.rad2deg(cones.clearance(jnp.array([0.0, 0.0, 0.0, 1.0])))[0].item())
        60
    """
    if not keep_out:
        return None
    dtype = context.inertia.dtype
    axes, directions = (
        np.array([getattr(cone, name) for cone in keep_out], float)
        for name in ("axis", "direction")
    )
    axes, directions = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (axes, directions))
    half_angles = np.deg2rad([cone.half_angle_deg for cone in keep_out])
    numbers = axes, directions, half_angles, 2 * context.kinematic_factor
    return Cones(*(jnp.asarray(x, dtype) for x in numbers))


def limits(cones: Cones | None) -> str:
    """What an assurance keeps, for people."""
    count = 0 if cones is None else len(cones.axes)
    return f"limits and {count} cone{'s' * (count > 1)}" if count else "limits"
