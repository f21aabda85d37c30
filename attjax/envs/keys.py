"""Keys of an episode's observations and steps, derived from the key of its reset."""

import chex
import jax
import numpy as np

_OBSERVATION, _STEPS, _WORLD = (np.uint32(2**32 - n) for n in (1, 2, 3))
"""What ``fold_in`` derives keys with that share nothing with the one they come from.

``uniform``, ``split`` and ``fold_in`` all encrypt numbers with the key: the first two 0, 1, 2, …,
the last the one that it is given, which must therefore be one that no draw counts up to.
"""


def observation_key(key: chex.PRNGKey) -> chex.PRNGKey:
    """The key of an episode's first observation, from the key of its reset."""
    return jax.random.fold_in(key, _OBSERVATION)


def steps_key(key: chex.PRNGKey) -> chex.PRNGKey:
    """The key of an episode's steps, from the key of its reset; a step's is folded in from it.

    Example:
        >>> key = steps_key(jax.random.key(0))
        >>> third = jax.random.fold_in(key, 2)
    """
    return jax.random.fold_in(key, _STEPS)


def world_key(key: chex.PRNGKey) -> chex.PRNGKey:
    """The key of an episode's world, from the key of its reset."""
    return jax.random.fold_in(key, _WORLD)
