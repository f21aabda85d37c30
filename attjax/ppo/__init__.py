"""Learning: networks, losses, rollouts and updates, fused in one compiled block."""

from attjax.ppo.train import train_block, update, with_advantages

__all__ = ["train_block", "update", "with_advantages"]
