"""Spacecraft of several kinds, for tests of their own units."""

import dataclasses
import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attjax import LM50, AttitudeEnv, Spacecraft

TURNED = Rotation.from_rotvec([0.4, -0.7, 0.2]).as_matrix()
TENSOR = (TURNED @ np.diag([0.872, 0.115, 0.797]) @ TURNED.T).tolist()
PULSES = Spacecraft(inertia=TENSOR)
SKEW = Spacecraft(
    inertia=TENSOR,
    torque_levels=(0.03, 0.02, 0.001),
    torque_axes=((1, 0.2, 0), (0, -1, 0.1), (0.3, 0, 1)),
    torque_held=True,
    rate_limit=0.3,
)
KINDS = pytest.mark.parametrize("craft", [LM50, PULSES, SKEW], ids=["lm50", "tensor", "skew"])


def context_of(craft, frameskip=5):
    env = AttitudeEnv(frameskip, spacecraft=craft)
    return env.context(env.default_params)


def renamed(craft):
    """The same spacecraft with its torque axes in all orders and both directions."""
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            axes = [tuple(s * x for x in craft.torque_axes[n]) for n, s in zip(order, signs)]
            yield dataclasses.replace(craft, torque_axes=tuple(axes))
