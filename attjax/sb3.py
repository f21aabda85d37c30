"""An earlier name of :mod:`attjax.wrappers.sb3`, which users' scripts may give."""

from attjax.wrappers.sb3 import as_vec_env

__all__ = ["as_vec_env"]
