"""Many outputs in one pass over a batch, which XLA's CPU compiler does not do by itself."""

import jax
import jax.numpy as jnp


def one_loop(function, *operands):
    """``function(*operands)``, under ``vmap`` compiled for CPU to a single loop over the batch.

    XLA's CPU compiler makes a loop for each output of an elementwise computation and repeats
    in it all that the outputs share, which for the seven components of an RK4 step takes three
    times as long. The one operation that it compiles to a loop with several outputs is the
    reduction, and the reducer may be any scalar function. So each operand is repeated, and the
    two copies are reduced by a reducer that ignores what came before: its result is the
    function of the second copy. Compilers for other devices reduce in another order, so this
    is for CPU only; it cannot be differentiated.

    Args:
        function: of scalars, to a tuple of scalars of the operands' type; elementwise
            operations only, and nothing but numbers from outside.
        operands: scalars of one floating-point type.

    Returns:
        The function's tuple.

    Example:
        >>> [x.item() for x in one_loop(lambda a, b: (a + b, a - b), 3.0, 1.0)]
        [4.0, 2.0]
    """
    operands = [jnp.asarray(x) for x in operands]
    arguments, outputs = len(operands), len(jax.eval_shape(function, *operands))
    operands += operands[:1] * (outputs - arguments)

    def reducer(_, current):
        return (*function(*current[:arguments]), *current[outputs:])

    copies = [jnp.broadcast_to(x, (2,)) for x in operands]
    zeros = [jnp.zeros((), x.dtype) for x in operands]
    return jax.lax.reduce(tuple(copies), tuple(zeros), reducer, (0,))[:outputs]
