"""Neural spacecraft attitude control: vectorised simulator and PPO in JAX."""

from attjax.env import AttitudeEnv
from attjax.spacecraft import EnvParams, EnvState, step

__all__ = ["AttitudeEnv", "EnvParams", "EnvState", "step"]
__version__ = "0.1.0"
