"""Items of a checkpoint, as Orbax reads them."""

from pathlib import Path
from typing import Any

import orbax.checkpoint as ocp


def read(path: Path, target: Any, is_part: bool) -> Any:
    """What is saved in ``path``, of the shapes and types of ``target`` and placed like it.

    Args:
        path: of the item.
        target: pytree of ``jax.ShapeDtypeStruct`` with shardings.
        is_part: whether the item may have more than ``target``, which is not read then.

    Raises:
        Exception: of many kinds, where it is damaged or of other shapes.
    """
    if not is_part:
        with ocp.StandardCheckpointer() as checkpointer:
            return checkpointer.restore(path, target)
    how = ocp.checkpoint_utils.construct_restore_args(target)
    part = ocp.args.PyTreeRestore(target, restore_args=how, partial_restore=True)
    with ocp.PyTreeCheckpointer() as checkpointer:
        return checkpointer.restore(path, args=part)
