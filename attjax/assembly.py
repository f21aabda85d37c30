"""From settings to the objects that they describe."""

from attjax import ppo
from attjax.env import AttitudeEnv
from attjax.networks import Policy
from attjax.reward import REWARDS
from attjax.settings import Settings


def policy(settings: Settings) -> Policy:
    """The policy, without parameters."""
    return Policy(
        features=settings.features,
        hidden_sizes=settings.hidden_sizes,
        rate_margin=settings.rate_margin,
    )


def setup(settings: Settings) -> ppo.Setup:
    """Environments, policy and settings of a training run."""
    reward = REWARDS[settings.reward]
    envs = tuple(AttitudeEnv(frameskip, reward) for frameskip in settings.frameskips)
    return ppo.Setup(envs, policy(settings), settings)
