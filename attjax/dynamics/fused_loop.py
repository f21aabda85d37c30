"""Many outputs in one pass over a batch, which XLA's CPU compiler does not do by itself."""

from collections.abc import Callable
from typing import Any, TypeVar

import chex
import jax
import jax.numpy as jnp

Tree = TypeVar("Tree")


def one_loop(function: Callable[..., Tree], *operands: Any) -> Tree:
    """``function(*operands)``, under ``vmap`` compiled for CPU to a single loop over the batch.

    XLA's CPU compiler makes a loop for each output of an elementwise computation and repeats
    in it all that the outputs share, which for the seven components of an RK4 step takes three
    times as long. The one operation that it compiles to a loop with several outputs is the
    reduction, and the reducer may be any scalar function. So each operand is repeated, and the
    two copies are reduced by a reducer that ignores what came before: its result is the
    function of the second copy. Compilers for other devices reduce in another order, so this
    is for CPU only; it cannot be differentiated.

    Args:
        function: of trees of scalars, to a tree of scalars of the operands' type; elementwise
            operations only, and nothing but numbers from outside.
        operands: trees of scalars of one floating-point type.

    Returns:
        The function's tree.

    Example:
        >>> both = one_loop(lambda x: {"sum": x["a"] + x["b"], "less": x["a"] - x["b"]},
        ...                 {"a": 3.0, "b": 1.0})
        >>> both["sum"].item(), both["less"].item()
        (4.0, 2.0)
    """
    leaves, structure = jax.tree.flatten(operands)
    shapes = jax.eval_shape(function, *operands)
    arguments, outputs = len(leaves), len(jax.tree.leaves(shapes))
    scalars = [jnp.asarray(x) for x in leaves]
    scalars += scalars[:1] * (outputs - arguments)

    # Called, for StableHLO's ReduceOpUnusedResultCanon walks through the reducer itself once for
    # each result that is ignored and again from each use: exponentially long. No call is entered.
    called = jax.jit(function)

    def reducer(_, current):
        values = called(*jax.tree.unflatten(structure, current[:arguments]))
        return (*jax.tree.leaves(values), *current[outputs:])

    copies = [jnp.broadcast_to(x, (2,)) for x in scalars]
    zeros = [jnp.zeros((), x.dtype) for x in scalars]
    reduced = jax.lax.reduce(tuple(copies), tuple(zeros), reducer, (0,))
    return jax.tree.unflatten(jax.tree.structure(shapes), reduced[:outputs])


@jax.custom_jvp
def apart(vector: chex.Array) -> chex.Array:
    """The same vector, under ``vmap`` on CPU worked out before the loops that use it begin.

    A loop in which it is looked up in a table, say, is one that the compiler does not vectorise.

    Args:
        vector: (n,) floating-point.

    Example:
        >>> apart(jnp.arange(3.0)).tolist()
        [0.0, 1.0, 2.0]
    """

    def by_a_loop(vector):
        return jnp.stack(one_loop(lambda *components: components, *vector))

    return jax.lax.platform_dependent(vector, cpu=by_a_loop, default=lambda vector: vector)


@apart.defjvp
def _apart_jvp(primals, tangents):
    return apart(*primals), tangents[0]
