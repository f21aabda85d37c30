"""The paper's slews of Table 5, and how fast a slew can be."""

import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv
from attjax.control import time_optimal
from attjax.evaluation import paper

pytestmark = pytest.mark.usefixtures("strict_promotion")

ENV = AttitudeEnv(frameskip=20)


def test_table_5_is_the_papers():
    """100° about axes of equal components, each in another octant."""
    octants = np.array([[1, 1, 1], [1, -1, 1], [-1, -1, 1]]) / np.sqrt(3)
    half = np.deg2rad(50)
    expected = np.hstack([octants * np.sin(half), np.full((3, 1), np.cos(half))])
    np.testing.assert_allclose(list(paper.TABLE_5.values()), expected, atol=6e-6)
    start = paper.table_5_slews()
    np.testing.assert_allclose(start.quaternion, expected, atol=6e-6)
    np.testing.assert_allclose(np.linalg.norm(start.quaternion, axis=1), 1, rtol=1e-7)
    assert not start.angular_velocity.any() and start.angular_velocity.shape == (3, 3)
    assert start.time.tolist() == [0, 0, 0] and start.time.dtype == jnp.int32


def test_time_optimal_reference_is_bang_bang():
    """About one axis: half the way at full torque, half of it braking; the times are additive.

    At constant acceleration a = U/I the first half of θ takes √(θ/a), and the second as long.
    """
    context = ENV.context(ENV.default_params)
    largest = 0.5 / 21  # N m, averaged over a control period
    for axis, inertia in enumerate((0.872, 0.115, 0.797)):
        half = 0.6
        slew = np.array([0, 0, 0, np.cos(half)])
        slew[axis] = np.sin(half)
        expected = 2 * np.sqrt(2 * half * inertia / largest)
        time = time_optimal.time_optimal_reference(jnp.array(slew, float), context)
        assert float(time) == pytest.approx(expected, rel=1e-5)
    for frameskip, expected in ((20, 17.4), (5, 9.3)):  # design figures of Table 5's slews
        env = AttitudeEnv(frameskip)
        context = env.context(env.default_params)
        for slew in paper.TABLE_5.values():
            time = time_optimal.time_optimal_reference(jnp.array(slew), context)
            assert float(time) == pytest.approx(expected, abs=0.05)
