"""Functions that differ from NumPy's in their gradients or in how they round."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float


def square_root(x: Float[Array | np.ndarray, "*shape"]) -> Float[Array, "*shape"]:
    """√x, element by element, with the gradient 0 where x is 0; that of the plain root is infinite.

    A norm made of it has a gradient everywhere: at the goal, and at rest, where ``jax.grad`` of
    the plain one is 0 · ∞, NaN.

    Example:
        >>> import jax
        >>> jax.grad(lambda x: square_root(jnp.sum(x**2)))(jnp.zeros(3)).tolist()
        [0.0, 0.0, 0.0]
    """
    positive = x > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, x, 1)), 0)


def add(
    total: tuple[Float[Array | np.ndarray, "*shape"], Float[Array | np.ndarray, "*shape"]],
    x: Float[Array | np.ndarray, "*shape"],
) -> tuple[Float[Array | np.ndarray, "*shape"], Float[Array | np.ndarray, "*shape"]]:
    """Add x to a compensated sum (Kahan's).

    Args:
        total: the sum so far, and what rounding has added to it too much; zeros at first.
        x: of the same shape.

    Returns:
        The new pair. Its first part is off by two roundings, however many terms there were.

    Example:
        >>> total = (jnp.float32(2**24), jnp.float32(0))
        >>> for _ in range(3):
        ...     total = add(total, jnp.float32(1))
        >>> total[0].item() - 2**24   # 0.0 by plain addition
        4.0
    """
    so_far, excess = total
    term = x - excess
    after = so_far + term
    return after, (after - so_far) - term
