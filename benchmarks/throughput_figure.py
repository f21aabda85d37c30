"""The figure of throughput against the number of spacecraft."""

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, FuncFormatter, LogLocator, NullLocator

COLORS = {
    "C ceiling, full step": "#555555",
    "C ceiling, physics only": "#aaaaaa",
    "attjax fused rollout": "#d1495b",
    "attjax physics only": "#e8a0a8",
    "attjax, user's vmap+scan": "#edae49",
    "attjax, Gymnasium make_vec": "#8c6d31",
    "Numba batch": "#00798c",
    "NumPy batch": "#30638e",
    "Numba RK4 in a Gym class": "#7a5195",
    "Basilisk in an RL loop": "#3a7d44",
}
"""By contender; dashed where it is the physics alone."""

LABEL_GAP = 1.45
"""Least ratio between the heights of two labels."""


def draw(result: dict, path: Path) -> None:
    """Draw simulator.py's result: medians as lines, ranges as bands, names at the lines' ends."""
    figure = Figure(figsize=(9.5, 6), dpi=160, layout="constrained")
    axes = figure.subplots()
    ends = {}
    for name, color in COLORS.items():
        rows = [row for row in result["rows"] if row["name"] == name]
        if rows:
            ends[name] = _line(axes, rows, color)
    right = max(x for x, _ in ends.values())
    _label(axes, {name: end for name, end in ends.items() if end[0] == right})
    for name in (name for name, (x, _) in ends.items() if x < right):
        offset = {"textcoords": "offset points", "xytext": (-3, 5)}
        text = name.replace(" in ", "\nin ")
        axes.annotate(text, ends[name], color=COLORS[name], fontsize=8.5, **offset)
    _decorate(axes, result["machine"], result["cores"])
    figure.savefig(path)


def _line(axes, rows, color):
    """Draw one contender; returns where its line ends."""
    sizes, medians = [row["num_envs"] for row in rows], [row["median"] for row in rows]
    style = "-" if rows[0]["full"] else "--"
    axes.plot(sizes, medians, style, color=color, marker="o", markersize=4, linewidth=1.8)
    low, high = [row["low"] for row in rows], [row["high"] for row in rows]
    axes.fill_between(sizes, low, high, color=color, alpha=0.15, linewidth=0)
    return sizes[-1], medians[-1]


def _label(axes, ends):
    """Names to the right of the axes, moved apart where the lines end close together."""
    height = None
    for name, (_, end) in sorted(ends.items(), key=lambda item: item[1][1]):
        height = end if height is None else max(end, height * LABEL_GAP)
        axes.annotate(
            name,
            (1.015, height),
            xycoords=("axes fraction", "data"),
            color=COLORS[name],
            fontsize=9.5,
            va="center",
            annotation_clip=False,
        )


def _decorate(axes, machine, cores):
    axes.set_xscale("log", base=2)
    axes.set_yscale("log")
    axes.margins(x=0.02)
    axes.xaxis.set_major_locator(LogLocator(base=4, numticks=20))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:,.0f}"))
    axes.yaxis.set_major_formatter(EngFormatter(sep=""))
    axes.tick_params(axis="x", rotation=30)
    axes.grid(alpha=0.3, linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("spacecraft side by side")
    axes.set_ylabel("agent-steps/s (21 RK4 steps each)")
    device = machine["device"] or f"{machine['processor']}, {cores} core{'s' * (cores > 1)}"
    axes.set_title(f"Simulator throughput on {device}", loc="left", fontsize=11)
