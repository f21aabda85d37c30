"""An earlier name of :mod:`attjax.wrappers.gymnasium`, which users' scripts and ids may give."""

from attjax.wrappers.gymnasium import ID, SlewEnv, SlewVectorEnv

__all__ = ["ID", "SlewEnv", "SlewVectorEnv"]
