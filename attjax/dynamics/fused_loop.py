"""Many outputs in one pass over a batch, which XLA's compilers do not do by themselves."""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import chex
import jax
import jax.numpy as jnp

Tree = TypeVar("Tree")
Scalars = Sequence[chex.Array]

NOTHING, GIVEN, FOUND = range(3)
"""What may meet in a reduction: nothing yet, operands, or what the function made of them."""


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
        function: of trees of scalars, to a tree of scalars; elementwise operations only, and
            nothing but numbers from outside.
        operands: trees of scalars of any types.

    Returns:
        The function's tree.

    Example:
        >>> both = one_loop(lambda x: {"sum": x["a"] + x["b"], "less": x["a"] - x["b"]},
        ...                 {"a": 3.0, "b": 1.0})
        >>> both["sum"].item(), both["less"].item()
        (4.0, 2.0)
    """
    flat = _flattened(function, operands)
    return flat.tree(_reduced(flat.scalars, 2, lambda _, current: flat.call(current)))


def one_kernel(function: Callable[..., Tree], *operands: Any) -> Tree:
    """As :func:`one_loop`, for GPUs: compiled to a single kernel, in seconds.

    XLA's GPU compiler has kernels with several outputs, but weighs every operation of a
    computation against all others before it puts them into one, which takes twenty seconds for an
    agent step's 21 RK4 steps. It does not look into a reducer.

    The result is right in whatever order a device reduces: what is reduced says of itself which of
    NOTHING, GIVEN and FOUND it is, and the function is applied to operands only. Where the
    compiler knows that, as in a loop through the copies, nothing remains of it. There are three
    copies, for threads would share out two among them, and do all twice.
    """
    flat = _flattened(function, operands)
    kind = jnp.asarray(GIVEN, jnp.int32)
    reduced = _reduced([*flat.scalars, kind], 3, any_order(flat.call))
    return flat.tree(reduced[:-1])


def any_order(call: Callable[[Scalars], Scalars]) -> Callable[[Scalars, Scalars], Scalars]:
    """A reducer of copies of the same operands to what ``call`` makes of them, in any order.

    Args:
        call: of scalars, to as many.

    Returns:
        The reducer, of scalars that are followed by which of NOTHING, GIVEN and FOUND they are.
    """

    def reducer(one, other):
        is_other = other[-1] != NOTHING
        *values, kind = (jnp.where(is_other, b, a) for a, b in zip(one, other))
        found = kind == FOUND
        values = [jnp.where(found, x, new) for x, new in zip(values, call(values))]
        return (*values, jnp.where(kind == NOTHING, kind, FOUND))

    return reducer


class _Flat(NamedTuple):
    """A function of trees as one of scalars, to as many of the same types."""

    scalars: list[chex.Array]
    call: Callable[[Scalars], Scalars]
    tree: Callable[[Scalars], Any]


def _flattened(function, operands):
    leaves, structure = jax.tree.flatten(operands)
    results, result_structure = jax.tree.flatten(jax.eval_shape(function, *operands))
    given = [jnp.asarray(x) for x in leaves]
    order = _order(given, results)
    places = [order.index(n) for n in range(len(given))]
    scalars = [
        _stand_in(given, result) if n is None else given[n]
        for n, result in zip(order, results + given)
    ]

    # Called, for StableHLO's ReduceOpUnusedResultCanon walks through the reducer itself once for
    # each result that is ignored and again from each use: exponentially long. No call is entered.
    called = jax.jit(function)

    def call(current):
        values = called(*jax.tree.unflatten(structure, [current[n] for n in places]))
        return (*jax.tree.leaves(values), *current[len(results) :])

    def tree(values):
        return jax.tree.unflatten(result_structure, values[: len(results)])

    return _Flat(scalars, call, tree)


def _order(given, results):
    """Which operand stands where, so that each result finds one of its type; None: none is left."""
    left, order = list(range(len(given))), []
    for result in results:
        place = next((n for n in left if given[n].dtype == result.dtype), None)
        left = [n for n in left if n != place]
        order.append(place)
    return order + left


def _stand_in(given, result):
    """For an operand where there are more results: any of the type, so that none is made up."""
    zero = jnp.zeros((), result.dtype)
    return next((x for x in given if x.dtype == result.dtype), zero)


def _reduced(scalars, count, reducer):
    """So many copies of the scalars, reduced from zeros on."""
    copies = tuple(jnp.broadcast_to(x, (count,)) for x in scalars)
    zeros = tuple(jnp.zeros((), x.dtype) for x in scalars)
    return jax.lax.reduce(copies, zeros, reducer, (0,))


@functools.partial(jax.custom_jvp, nondiff_argnums=(0,))
def together(function: Callable[..., Tree], *operands: Any) -> Tree:
    """``function(*operands)``, as of :func:`one_loop` where the device is a CPU.

    For what several things share that are worked out of it; it has the function's derivatives.

    Example:
        >>> float(jax.grad(lambda x: together(lambda y: y**3, x))(2.0))
        12.0
    """
    if not jax.tree.leaves(jax.eval_shape(function, *operands)):
        return function(*operands)  # the compiler crashes on a reduction of nothing
    return jax.lax.platform_dependent(
        *operands, cpu=functools.partial(one_loop, function), default=function
    )


@together.defjvp
def _together_jvp(function, primals, tangents):
    return jax.jvp(function, primals, tangents)


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
