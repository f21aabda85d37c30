import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attjax.dynamics import quaternion as quaternions

pytestmark = pytest.mark.usefixtures("strict_promotion")


def random_quaternions(n, seed=0):
    q = np.random.default_rng(seed).normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def test_axis_angle_agrees_with_scipy(x64):
    rng = np.random.default_rng(1)
    axes = rng.normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = rng.uniform(0, np.pi, 50)
    ours = jax.vmap(quaternions.from_axis_angle)(axes, angles)
    expected = Rotation.from_rotvec(axes * angles[:, None]).as_quat()
    np.testing.assert_allclose(ours, expected, atol=1e-15)
    np.testing.assert_allclose(jax.vmap(quaternions.error_angle)(ours), angles, atol=1e-14)


def test_derivative_is_half_omega_matrix_times_q(x64):
    """Eq. 9 and 10, written out as the paper's 4x4 block matrix."""
    w = np.array([0.1, -0.2, 0.3])
    cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])  # Eq. 7
    omega = np.block([[-cross, w[:, None]], [-w[None], np.zeros((1, 1))]])  # Eq. 10
    for q in random_quaternions(20):
        derivative = jnp.stack(quaternions.derivative(q, w))
        np.testing.assert_allclose(derivative, 0.5 * omega @ q, atol=1e-16)
        np.testing.assert_allclose(derivative @ q, 0, atol=1e-16)  # keeps the norm


def test_derivative_is_that_of_scipys_rotations(x64):
    """Body rates compose on the right: q(t + dt) = q(t) ⊗ exp(ω dt/2)."""
    w, dt = np.array([0.3, -0.1, 0.2]), 1e-6
    for q in random_quaternions(10, seed=2):
        later = (Rotation.from_quat(q) * Rotation.from_rotvec(w * dt)).as_quat()
        later *= np.sign(later @ q)
        finite_difference = (later - q) / dt
        derivative = np.array(quaternions.derivative(q, w))
        np.testing.assert_allclose(derivative, finite_difference, atol=1e-6)


@pytest.mark.parametrize("degrees", [1e-6, 1e-5, 1e-3, 0.04, 0.25, 30.0, 150.0, 179.9])
def test_angle_is_sharp_in_float32(degrees):
    """Also far below 0.04°, where float32 cos(φ/2) is exactly 1."""
    half = np.deg2rad(degrees) / 2
    axis = np.array([0.6, -0.48, 0.64])
    q = jnp.array([*(axis * np.sin(half)), np.cos(half)], jnp.float32)
    angle = np.rad2deg(float(quaternions.error_angle(q)))
    assert angle == pytest.approx(degrees, rel=1e-6)


def test_angle_keeps_the_sign_of_the_scalar_part():
    near_antipode = jnp.array([1e-3, 0.0, 0.0, -1.0])
    assert quaternions.error_angle(near_antipode) == pytest.approx(2 * np.pi - 2e-3, abs=1e-6)
    assert quaternions.error_angle(jnp.array([0.0, 0.0, 0.0, 1.0])) == 0
    assert quaternions.error_angle(jnp.array([0.0, 0.0, 0.0, -1.0])) == pytest.approx(2 * np.pi)


def test_normalize(x64):
    for q in random_quaternions(5):
        np.testing.assert_allclose(quaternions.normalize(jnp.array(3 * q)), q, atol=1e-15)


def test_rotation_vector_is_scipys_shortest(x64):
    """Axis times angle, of q and of −q alike."""
    for q in random_quaternions(20, seed=3):
        expected = Rotation.from_quat(q).as_rotvec()
        np.testing.assert_allclose(quaternions.rotation_vector(jnp.array(q)), expected, atol=1e-14)
        np.testing.assert_allclose(quaternions.rotation_vector(jnp.array(-q)), expected, atol=1e-14)


def test_rotation_vector_at_the_goal_and_just_beside_it(x64):
    """Twice the vector part there, whatever its size; a half turn keeps the axis as it is."""
    for vector in ([0, 0, 0], [3e-200, 1e-200, 0], [1e-9, 2e-9, -3e-9]):
        for sign in (1, -1):
            q = jnp.array([*vector, sign], float)
            expected = 2 * sign * np.array(vector, float)
            np.testing.assert_allclose(quaternions.rotation_vector(q), expected, rtol=1e-12)
    half_turn = quaternions.rotation_vector(jnp.array([0.6, 0.0, -0.8, 0.0]))
    np.testing.assert_allclose(half_turn, np.pi * np.array([0.6, 0, -0.8]))
