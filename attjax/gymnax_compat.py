"""An earlier name of :mod:`attjax.wrappers.gymnax`, which users' scripts may give."""

from attjax.wrappers.gymnax import FiveValueEnv, GymnaxEnv

__all__ = ["FiveValueEnv", "GymnaxEnv"]
