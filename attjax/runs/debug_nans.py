"""Finds the operation that makes a run diverge, for ``train.py --debug-nans``."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path

import chex
import jax
from jax.experimental import checkify

from attjax import ppo
from attjax.ppo.train_state import Learner, Setup

FOLDER = Path(__file__).parents[1]


class NotFinite(Exception):
    """An operation made a NaN or divided by zero; the message names it and its line."""


def train_block(
    setup: Setup, env_params: chex.ArrayTree, learner: Learner
) -> Callable[[chex.ArrayTree, Learner, int], tuple[Learner, dict]]:
    """Compile :func:`attjax.ppo.train_block` with a check after every operation.

    Two to three times as slow, and its argument is not donated. The values are the same up to
    rounding: the compiler fuses other operations.

    Returns:
        Function of the parameters, the learner and the number of updates, with the results of
        the original.

    Raises:
        NotFinite: by that function.
    """
    block = functools.partial(inspect.unwrap(ppo.train_block), setup)
    checked = jax.jit(checkify.checkify(block, errors=checkify.float_checks))
    compiled = checked.lower(env_params, learner, 1).compile()

    def run(env_params, learner, num_updates):
        error, result = compiled(env_params, learner, num_updates)
        found = error.get_exception()
        if found is not None:
            raise NotFinite(_described(found))
        return result

    return run


def _described(found):
    """The operation, and the innermost line of ours that led to it, or of what we called."""
    first = next(iter(getattr(found, "error_mapping", {None: found}).values()))
    frames = first.traceback_info.frames
    ours = [frame for frame in frames if Path(frame.file_name).is_relative_to(FOLDER)]
    frame = (ours or frames[-1:])[0]
    what = str(first).strip().rstrip(".")
    return f"{what}, in {Path(frame.file_name).name}, line {frame.line_num}, {frame.function_name}"
