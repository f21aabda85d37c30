import jax
import jax.numpy as jnp
import numpy as np

from attjax.dynamics import numerics


def test_square_root_and_its_gradient_by_hand():
    """1/(2√x), and 0 at and below 0, where the root is 0."""
    x = jnp.array([-4.0, -0.0625, 0.0, 0.0625, 0.25, 4.0])
    np.testing.assert_array_equal(numerics.square_root(x), [0, 0, 0, 0.25, 0.5, 2])
    with jax.debug_nans(True):  # nor does a NaN come up on the way
        slope = jax.vmap(jax.grad(numerics.square_root))(x)
    np.testing.assert_array_equal(slope, [0, 0, 0, 2, 1, 0.25])


def test_polar_angle_in_float32_is_numpys_to_2e_7():
    """At all slopes, from the smallest numbers on, and on both axes."""
    slope = np.linspace(0, np.pi, 100_001)
    length = 10.0 ** np.random.default_rng(3).uniform(-30, 30, len(slope))
    y = np.abs(length * np.sin(slope)).astype(np.float32)
    x = (length * np.cos(slope)).astype(np.float32)
    y, x = np.append(y, [0, 0, 0, 1, 1e-38, 2]), np.append(x, [0, 1, -1, 0, -1, 2])
    expected = np.arctan2(y.astype(float), x.astype(float))
    ours = numerics.polar_angle(jnp.float32(y), jnp.float32(x))
    np.testing.assert_allclose(ours, expected, rtol=2e-7, atol=0)


def test_polar_angle_in_float64_is_numpys(x64):
    y, x = np.abs(np.random.default_rng(4).normal(size=(2, 99))) * [[1], [-1]]
    np.testing.assert_allclose(numerics.polar_angle(y, x), np.arctan2(y, x), rtol=1e-15)


def test_gradients_of_the_polar_angle_by_hand():
    """(x, −y)/(x² + y²), also where the polynomial's pieces meet; 0 at the origin."""
    y, x = jnp.float32([[1, 3, 1, 1, 0, 0], [0, 4, 1, -1, 2, 0]])
    slopes = jax.vmap(jax.grad(numerics.polar_angle, (0, 1)))(y, x)
    expected = [[0, 4 / 25, 0.5, -0.5, 0.5, 0], [-1, -3 / 25, -0.5, -0.5, 0, 0]]
    np.testing.assert_allclose(slopes, expected, rtol=1e-6)


def test_compensated_sum_by_hand():
    """Float32 has no integers but multiples of 4 around 2^25: what is lost comes back later."""
    total = (jnp.float32(2**25), jnp.float32(0))
    steps = [total := numerics.add(total, jnp.float32(x)) for x in (1, 1, 1, -8)]
    assert [float(x) - 2**25 for x, _ in steps] == [0, 0, 4, -4]
    assert [float(excess) for _, excess in steps] == [-1, -2, 1, 1]
