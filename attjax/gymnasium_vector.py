"""An earlier name of :mod:`attjax.wrappers.gymnasium`, which users' scripts may give."""

from attjax.wrappers.gymnasium import SlewVectorEnv

__all__ = ["SlewVectorEnv"]
