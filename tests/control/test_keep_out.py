"""Keep-out cones: their frames, and how they are described."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attjax import AttitudeEnv
from attjax.control.keep_out import cones_of
from attjax.world import KeepOut, keep_out

ENV = AttitudeEnv(5)
CONTEXT = ENV.context(ENV.default_params)


def test_clearance_is_the_angle_between_the_axis_and_the_direction(x64):
    """The attitude turns the body's axis into the target's frame, where the direction is."""
    rng = np.random.default_rng(0)
    for attitude in Rotation.random(20, random_state=1):
        axis, direction = rng.normal(size=(2, 3))
        cone = KeepOut(axis=tuple(axis), direction=tuple(direction), half_angle_deg=25)
        cones = cones_of([cone], ENV.context(ENV.default_params))
        turned = attitude.apply(axis / np.linalg.norm(axis))
        angle = np.arccos(turned @ direction / np.linalg.norm(direction))
        found = cones.clearance(jnp.asarray(attitude.as_quat()))[0]
        assert float(found) == pytest.approx(angle - np.deg2rad(25), abs=1e-7)
        np.testing.assert_allclose(
            cones.seen(jnp.asarray(attitude.as_quat()))[0],
            attitude.inv().apply(direction / np.linalg.norm(direction)),
            atol=1e-12,
        )


def test_at_the_goal_both_frames_are_one():
    cone = KeepOut(axis=(0, 0, 1), direction=(0, 0, 3), half_angle_deg=10)
    clearance = cones_of([cone], CONTEXT).clearance(jnp.array([0.0, 0.0, 0.0, 1.0]))
    assert float(clearance[0]) == pytest.approx(-np.deg2rad(10), abs=1e-6)
    assert cones_of([], CONTEXT) is None


def test_a_file_of_cones(tmp_path):
    file = tmp_path / "cones.toml"
    file.write_text(
        "[[keep_out]]\naxis = [0, 0, 1]\ndirection = [1, 0, 0]\nhalf_angle_deg = 30\n"
        "[[keep_out]]\naxis = [1, 0, 0]\ndirection = [1, 1, 0]\nhalf_angle_deg = 12.5\n"
    )
    first, second = keep_out.from_toml(file)
    assert first == KeepOut(axis=(0, 0, 1), direction=(1, 0, 0), half_angle_deg=30)
    assert second.half_angle_deg == 12.5


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ({}, "no table"),
        ({"keep_out": {"axis": [1, 0, 0]}}, "no table"),
        ({"cone": []}, "cone is unknown"),
        ({"keep_out": [3]}, r"keep_out\[1\] is 3; it must be a table"),
        ({"keep_out": [{"axis": [0, 0, 1], "direction": [1, 0, 0]}]}, r"keep_out\[1\] lacks"),
        ({"keep_out": [{"axis": [0, 0, 0], "direction": [1, 0, 0], "half_angle_deg": 1}]}, "zero"),
        ({"keep_out": [{"axis": [0, 1, 0], "direction": [1], "half_angle_deg": 1}]}, "direction"),
        (
            {"keep_out": [{"axis": [0, 1, 0], "direction": [1, 0, 0], "half_angle_deg": 180}]},
            "half_angle_deg is 180; it must be",
        ),
    ],
)  # fmt: skip
def test_descriptions_that_are_none(content, match):
    with pytest.raises(ValueError, match=match):
        keep_out.from_lists(content)
