"""Neural spacecraft attitude control: vectorised simulator and PPO in JAX."""

import importlib

__all__ = ["AttitudeEnv", "EnvParams", "EnvState", "Spacecraft", "step"]
__version__ = "0.1.0"

_MODULES = {"AttitudeEnv": "env", "Spacecraft": "specification"}


def __getattr__(name):
    """Import at first use: JAX takes seconds, which ``train.py --help`` need not."""
    if name not in __all__:
        raise AttributeError(f"module 'attjax' has no attribute {name!r}")
    return getattr(importlib.import_module("attjax." + _MODULES.get(name, "spacecraft")), name)
