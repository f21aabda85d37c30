"""The paper's results, to stand beside ours, and the slews of its examples."""

import dataclasses

import jax.numpy as jnp

from attjax.envs.parameters import EnvState
from attjax.spacecraft import LM50, Spacecraft
from attjax.world import IDEAL

PAPER_TABLE_2 = {
    ("closest", "error_deg"): (
        0.000380, 0.000233, 0.000007, 0.000203, 0.000335, 0.000518, 0.001980),
    ("closest", "rate_rad_s"): (
        0.001976, 0.001316, 0.000066, 0.001387, 0.001868, 0.002371, 0.019339),
    ("terminal", "error_deg"): (
        0.001954, 0.000705, 0.000137, 0.001456, 0.001923, 0.002433, 0.004558),
    ("terminal", "rate_rad_s"): (
        0.001752, 0.001088, 0.000106, 0.001215, 0.001649, 0.002155, 0.018723),
}  # fmt: skip
"""Table 2 of the paper, in the order of STATISTICS; angles in degrees, rates in rad/s."""

TABLE_5 = {
    "slew1": (0.44228, 0.44228, 0.44228, 0.64279),
    "slew2": (0.44228, -0.44228, 0.44228, 0.64279),
    "slew3": (-0.44228, -0.44228, 0.44228, 0.64279),
}
"""Initial error quaternions of the paper's three control examples, 100° each."""


def table_5_slews() -> EnvState:
    """States at the start of the slews of TABLE_5, as a batch of 3, at rest."""
    quaternion = jnp.array(list(TABLE_5.values()), float)
    quaternion /= jnp.linalg.norm(quaternion, axis=-1, keepdims=True)
    n = len(quaternion)
    return EnvState(quaternion, jnp.zeros((n, 3)), jnp.zeros(n, jnp.int32))


def is_the_papers(spacecraft: Spacecraft, world: str = IDEAL.name) -> bool:
    """Whether the paper's results can stand beside a spacecraft's; the duration may differ."""
    is_its_craft = dataclasses.replace(spacecraft, duration=LM50.duration) == LM50
    return is_its_craft and world == IDEAL.name
