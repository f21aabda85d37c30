"""The figure of time_to_quality.py."""

from pathlib import Path

import matplotlib

from attjax.evaluation.paper import PAPER_TABLE_2

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

PAPER_ERROR = PAPER_TABLE_2["terminal", "error_deg"][0]
STAR = {"markersize": 11, "markeredgecolor": "black"}


def plot(curves: dict, plateau: float, path: Path) -> None:
    """Draw terminal error and return of the recipes' points against the clock."""
    figure, (errors, returns) = plt.subplots(
        2, 1, sharex=True, figsize=(8, 7), layout="constrained"
    )
    for name, curve in curves.items():
        seconds = [point.seconds for point in curve]
        (line,) = errors.plot(seconds, [p.mean_error for p in curve], ".-", label=name)
        returns.plot(seconds, [p.episode_return for p in curve], ".-", color=line.get_color())
        mark_first(errors, curve, "beats_table_2", "mean_error", line.get_color())
        mark_first(returns, curve, "reaches_plateau", "episode_return", line.get_color())
    level(errors, PAPER_ERROR)
    level(returns, plateau, "the paper's mean and its plateau")
    errors.plot([], [], "*", color="white", label="Table 2 beaten; plateau reached", **STAR)
    errors.set(yscale="log", xscale="log", ylabel="terminal error at 40 Hz, mean (°)")
    returns.set(xlabel="time since the start of train.py (s)")
    returns.set_ylabel("return at 11.43 Hz, mean (Eq. 12–13)")
    returns.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    returns.xaxis.set_major_formatter(ScalarFormatter())
    returns.xaxis.set_minor_formatter(NullFormatter())
    figure.suptitle("The greedy policy during training")
    figure.legend(loc="outside lower center", ncols=2)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def mark_first(axis, curve, criterion: str, quantity: str, color: str) -> None:
    """A star where the criterion is first met."""
    point = next((point for point in curve if getattr(point, criterion)), None)
    if point is not None:
        axis.plot(point.seconds, getattr(point, quantity), "*", color=color, zorder=3, **STAR)


def level(axis, value: float, name: str | None = None) -> None:
    """A line at the paper's value."""
    axis.axhline(value, color="0.4", linestyle="--", linewidth=1, label=name)
    axis.grid(alpha=0.3)
