"""Spacecraft that the tests of the physics share."""

import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from attjax import spacecraft

LM50 = np.array(spacecraft.LM50.inertia)


def rotated_inertia():
    rotation = Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix()
    return rotation @ np.diag(LM50) @ rotation.T


def random_spacecraft(count):
    """Quaternions, angular velocities and torques, with a leading axis (count,)."""
    rng = np.random.default_rng(0)
    quaternion = Rotation.random(count, random_state=0).as_quat()
    rate, torque = rng.uniform(-0.3, 0.3, (2, count, 3))
    return [jnp.asarray(x, float) for x in (quaternion, rate, torque)]
