"""Rows of metrics as a run has them, of numbers that are easy to tell apart."""

from attjax.runs import metrics

LOSSES = {
    "entropy": 2.345, "approximate_kl": 0.00123, "clip_fraction": 0.043, "policy_loss": -0.01,
    "value_loss": 1.23e-05, "explained_variance": -0.98765,
}  # fmt: skip
EPISODES = {
    "episode_return": 13807.2, "success_rate": 0.984, "terminal_error_deg": 0.000123,
    "overspeed_rate": 0.016,
}  # fmt: skip


def row(steps, **values):
    return (
        dict.fromkeys(metrics.columns()) | {"agent_steps": steps, "episodes": 0} | LOSSES | values
    )
