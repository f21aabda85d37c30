"""The three training recipes. Every value can be overridden from the command line."""

import dataclasses

from attjax.settings import Settings


@dataclasses.dataclass(frozen=True, kw_only=True)
class Paper(Settings):
    """All that the paper names, to the letter; it does not give N (``passes``)."""

    frameskips: tuple[int, ...] = (20,)
    reward: str = "paper"
    reward_scale: float = 1.0
    time_limit_terminates: bool = True
    stagger_episodes: bool = False
    features: str = "state"
    hidden_sizes: tuple[int, ...] = (400, 300)
    rate_margin: float = 0.0
    total_steps: int = 4340 * 30 * 500
    num_envs: int = 30
    rollout_length: int = 500
    passes: int = 10
    minibatch_size: int = 128
    discount: float = 0.99
    discount_period: float = 0.0
    gae_lambda: float = 1.0
    clip: float = 0.2
    entropy_coefficient: float = 1e-4
    learning_rate: float = 3e-4
    final_learning_rate: float = 1e-5
    normalize_advantage: bool = False
    max_gradient_norm: float = 0.0
    updates_per_block: int = 2


@dataclasses.dataclass(frozen=True, kw_only=True)
class PaperFast(Paper):
    """The paper's state, reward, networks, γ, ε, c and learning rates; the rest is ours."""

    reward_scale: float = 0.01
    stagger_episodes: bool = True
    total_steps: int = 12_000_000
    num_envs: int = 512
    rollout_length: int = 128
    passes: int = 4
    minibatch_size: int = 1024
    gae_lambda: float = 0.95
    normalize_advantage: bool = True
    max_gradient_norm: float = 0.5


@dataclasses.dataclass(frozen=True, kw_only=True)
class Precise(Settings):
    """The default: one policy for every control rate, pointing far below Table 2."""

    frameskips: tuple[int, ...] = (5, 7, 10, 14, 20)
    reward: str = "logarithmic"
    reward_scale: float = 0.005
    time_limit_terminates: bool = False
    stagger_episodes: bool = True
    features: str = "multiscale"
    hidden_sizes: tuple[int, ...] = (64, 64)
    rate_margin: float = 0.9
    total_steps: int = 32_000_000
    num_envs: int = 2048
    rollout_length: int = 64
    passes: int = 4
    minibatch_size: int = 2048
    discount: float = 0.995
    discount_period: float = 0.025
    gae_lambda: float = 0.95
    clip: float = 0.2
    entropy_coefficient: float = 0.0
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-6
    normalize_advantage: bool = True
    max_gradient_norm: float = 0.5
    updates_per_block: int = 4


PRESETS = {"precise": Precise, "paper": Paper, "paper-fast": PaperFast}
