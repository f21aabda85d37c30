"""New episodes in place of those that ended: of a batch, or of one that may be of a batch."""

import functools
from collections.abc import Callable

import chex
import jax
import jax.numpy as jnp

PORTIONS = 16
"""On CPU they are drawn for a batch's 16th part at a time: rarely more end in one step."""


def restart(
    reset: Callable[[chex.Array], chex.ArrayTree], ended: chex.Array, ongoing: chex.ArrayTree
) -> chex.ArrayTree:
    """Replace what belongs to ended episodes by fresh ones, as is best for the device.

    Args:
        reset: function of a row of the batch, to what belongs to that row at its new start.
        ended: (batch,) bool.
        ongoing: pytree with leaves (batch, ...).

    Returns:
        The pytree with the ended rows replaced.
    """
    return jax.lax.platform_dependent(
        ended,
        ongoing,
        cpu=functools.partial(restart_few, reset),
        default=functools.partial(restart_all, reset),
    )


def restart_all(
    reset: Callable[[chex.Array], chex.ArrayTree], ended: chex.Array, ongoing: chex.ArrayTree
) -> chex.ArrayTree:
    """As :func:`restart`, drawing an episode for every row.

    On a GPU that is a kernel or two; a loop, for whose end the host has to ask, is twenty.
    """
    fresh = jax.vmap(reset)(jnp.arange(len(ended)))

    def chosen(new, old):
        return jnp.where(ended.reshape(-1, *(1,) * (old.ndim - 1)), new, old)

    return jax.tree.map(chosen, fresh, ongoing)


def restart_few(
    reset: Callable[[chex.Array], chex.ArrayTree], ended: chex.Array, ongoing: chex.ArrayTree
) -> chex.ArrayTree:
    """As :func:`restart`, a portion of the batch at a time, until there are no more."""
    batch = len(ended)
    portion = max(1, batch // PORTIONS)

    def replace(carry):
        ended, ongoing = carry
        is_ended, rows = jax.lax.top_k(ended.astype(jnp.float32), portion)
        fresh = jax.vmap(reset)(rows)
        rows = jnp.where(is_ended > 0, rows, batch)
        ongoing = jax.tree.map(lambda x, new: x.at[rows].set(new, mode="drop"), ongoing, fresh)
        return ended.at[rows].set(False, mode="drop"), ongoing

    return jax.lax.while_loop(lambda carry: jnp.any(carry[0]), replace, (ended, ongoing))[1]


def restart_one(
    reset: Callable[..., chex.ArrayTree],
    given: tuple,
    ended: chex.Array,
    ongoing: chex.ArrayTree,
) -> chex.ArrayTree:
    """The same for one spacecraft. Under ``vmap`` it is :func:`restart` of the whole batch.

    Args:
        reset: function of ``given``, to what belongs to the spacecraft at its new start.
        given: arrays, or pytrees of them.
        ended: () bool.
        ongoing: pytree.
    """
    reset, closed_over = jax.closure_convert(reset, *given)
    given = (*given, *closed_over)

    def of_one(given, ended, ongoing):
        return jax.tree.map(lambda new, old: jnp.where(ended, new, old), reset(*given), ongoing)

    batched = jax.custom_batching.custom_vmap(of_one)

    @batched.def_vmap
    def _of_a_batch(size, is_batched, given, ended, ongoing):
        def reset_row(row):
            return reset(*jax.tree.map(lambda x, own: x[row] if own else x, given, is_batched[0]))

        ended, ongoing = jax.tree.map(
            lambda x, own: x if own else jnp.broadcast_to(x, (size, *x.shape)),
            (ended, ongoing),
            tuple(is_batched[1:]),
        )
        return restart(reset_row, ended, ongoing), jax.tree.map(lambda _: True, ongoing)

    with_gradients = jax.custom_jvp(batched)  # a loop has none in reverse

    @with_gradients.defjvp
    def _jvp(primals, tangents):
        return jax.jvp(of_one, primals, tangents)

    return with_gradients(given, ended, ongoing)
