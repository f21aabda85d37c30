"""Neural spacecraft attitude control: vectorised simulator and PPO in JAX."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from attjax.control.flight_loop import flight_loop
    from attjax.envs.attitude import AttitudeEnv
    from attjax.envs.batch import open_loop
    from attjax.envs.parameters import EnvParams, EnvState
    from attjax.envs.simulator import step
    from attjax.evaluation import evaluate
    from attjax.runs.checkpoint import load_policy
    from attjax.runs.flight import load_flight_loop
    from attjax.runs.trainer import train
    from attjax.spacecraft import LM50, Spacecraft
    from attjax.world import World

__all__ = [
    "LM50",
    "AttitudeEnv",
    "EnvParams",
    "EnvState",
    "Spacecraft",
    "World",
    "evaluate",
    "flight_loop",
    "load_flight_loop",
    "load_policy",
    "open_loop",
    "step",
    "train",
]
__version__ = "0.1.0"

_MODULES = {
    "AttitudeEnv": "attjax.envs.attitude",
    "EnvParams": "attjax.envs.parameters",
    "EnvState": "attjax.envs.parameters",
    "LM50": "attjax.spacecraft",
    "Spacecraft": "attjax.spacecraft",
    "World": "attjax.world",
    "evaluate": "attjax.evaluation",
    "flight_loop": "attjax.control.flight_loop",
    "load_flight_loop": "attjax.runs.flight",
    "load_policy": "attjax.runs.checkpoint",
    "open_loop": "attjax.envs.batch",
    "step": "attjax.envs.simulator",
    "train": "attjax.runs.trainer",
}


def __getattr__(name: str) -> Any:
    """Import at first use: JAX takes seconds, which ``train.py --help`` need not."""
    if name not in _MODULES:
        raise AttributeError(f"module 'attjax' has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    """The public names, too."""
    return sorted({*globals(), *__all__})
