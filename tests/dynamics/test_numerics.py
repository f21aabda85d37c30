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


def test_compensated_sum_by_hand():
    """Float32 has no integers but multiples of 4 around 2^25: what is lost comes back later."""
    total = (jnp.float32(2**25), jnp.float32(0))
    steps = [total := numerics.add(total, jnp.float32(x)) for x in (1, 1, 1, -8)]
    assert [float(x) - 2**25 for x, _ in steps] == [0, 0, 4, -4]
    assert [float(excess) for _, excess in steps] == [-1, -2, 1, 1]
