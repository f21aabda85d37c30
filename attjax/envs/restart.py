"""New episodes in place of those of a batch that ended."""

import functools
from collections.abc import Callable

import chex
import jax
import jax.numpy as jnp

PORTIONS = 16
"""On CPU they are drawn for a batch's 16th part at a time: rarely more end in one step."""


def restart(
    reset: Callable[[chex.PRNGKey, chex.Array], chex.ArrayTree],
    key: chex.PRNGKey,
    ended: chex.Array,
    ongoing: chex.ArrayTree,
) -> chex.ArrayTree:
    """Replace what belongs to ended episodes by fresh ones, as is best for the device.

    Args:
        reset: function of a key and a row of the batch, to what belongs to that row.
        key: of the new episodes; which they are depends on the kind of device, too.
        ended: (batch,) bool.
        ongoing: pytree with leaves (batch, ...).

    Returns:
        The pytree with the ended rows replaced.
    """
    return jax.lax.platform_dependent(
        key,
        ended,
        ongoing,
        cpu=functools.partial(restart_few, reset),
        default=functools.partial(restart_all, reset),
    )


def restart_all(
    reset: Callable[[chex.PRNGKey, chex.Array], chex.ArrayTree],
    key: chex.PRNGKey,
    ended: chex.Array,
    ongoing: chex.ArrayTree,
) -> chex.ArrayTree:
    """As :func:`restart`, drawing an episode for every row.

    On a GPU that is a kernel or two; a loop, for whose end the host has to ask, is twenty.
    """
    fresh = jax.vmap(reset)(jax.random.split(key, len(ended)), jnp.arange(len(ended)))

    def chosen(new, old):
        return jnp.where(ended.reshape(-1, *(1,) * (old.ndim - 1)), new, old)

    return jax.tree.map(chosen, fresh, ongoing)


def restart_few(
    reset: Callable[[chex.PRNGKey, chex.Array], chex.ArrayTree],
    key: chex.PRNGKey,
    ended: chex.Array,
    ongoing: chex.ArrayTree,
) -> chex.ArrayTree:
    """As :func:`restart`, a portion of the batch at a time, until there are no more."""
    batch = len(ended)
    portion = max(1, batch // PORTIONS)

    def replace(carry):
        key, ended, ongoing = carry
        key, fresh_key = jax.random.split(key)
        is_ended, rows = jax.lax.top_k(ended.astype(jnp.float32), portion)
        fresh = jax.vmap(reset)(jax.random.split(fresh_key, portion), rows)
        rows = jnp.where(is_ended > 0, rows, batch)
        ongoing = jax.tree.map(lambda x, new: x.at[rows].set(new, mode="drop"), ongoing, fresh)
        return key, ended.at[rows].set(False, mode="drop"), ongoing

    return jax.lax.while_loop(lambda carry: jnp.any(carry[1]), replace, (key, ended, ongoing))[2]
