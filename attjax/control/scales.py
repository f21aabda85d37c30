"""Inputs at several scales, each of which resolves decades of its own."""

import chex
import jax.numpy as jnp
import numpy as np

from attjax.dynamics.numerics import matmul


def at_all_scales(scaled: chex.Array, factors: np.ndarray, plain: chex.Array) -> chex.Array:
    """(columns + plain,) tanh of ``scaled`` (n,) times ``factors`` (n, columns), then ``plain``.

    One product instead of a concatenation of all the parts: in a batch the features of a
    spacecraft come to lie side by side, and tanh runs over them several times as fast.
    """
    factors = np.pad(factors, (0, plain.size)).astype(scaled.dtype)
    factors[scaled.size :, -plain.size :] = np.eye(plain.size)
    features = matmul(jnp.concatenate([scaled, plain]), factors)
    return jnp.where(np.any(factors[: scaled.size], axis=0), jnp.tanh(features), features)
