"""Figures of ``eval.py --robustness``. Needs the extra ``plot`` (matplotlib)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from attjax import canvas
from attjax.evaluation.robustness_table import angle, way

MARKERS = "o^sDv"
FILLS = {"loop": "full", "adaptive": "left", "bare": "none"}
LEAST_DEG = 1e-6
"""Smaller angles are drawn as this, as a logarithm needs one."""


def write_all(rows: Sequence[dict], folder: Path) -> list[Path]:
    """Write both figures of the rows into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    return [heat_map(rows, folder), pointing_against_knowledge(rows, folder)]


@canvas.own_style()
def heat_map(rows: Sequence[dict], folder: Path) -> Path:
    """Success and pointing of each controller in each condition."""
    conditions = list(dict.fromkeys(row["condition"] for row in rows))
    flown = list(dict.fromkeys((row["controller"], way(row)) for row in rows))
    angles = np.full((len(conditions), len(flown)), np.nan)
    figure, axis = canvas.subplots(figsize=(3 + 1.5 * len(flown), 1 + 0.32 * len(conditions)))
    for row in rows:
        y = conditions.index(row["condition"])
        x = flown.index((row["controller"], way(row)))
        if row["rms_deg"] is not None:
            angles[y, x] = max(row["rms_deg"], LEAST_DEG)
        is_dark = abs(np.log10(angles[y, x]) + 1.5) > 2  # and not where there is no angle
        ink = "white" if is_dark else "black"
        axis.text(x, y, _words(row), ha="center", va="center", fontsize=7, color=ink)
    image = axis.imshow(np.log10(angles), aspect="auto", cmap="RdYlGn_r", vmin=-4.5, vmax=1.5)
    figure.colorbar(image, label="log10 of the rms error over the last fifth (°)")
    names = [f"{name}\n{'flight loop' if how == 'loop' else how}" for name, how in flown]
    axis.set_xticks(range(len(flown)), names, fontsize=8)
    axis.set_yticks(range(len(conditions)), conditions, fontsize=8)
    axis.xaxis.tick_top()
    return canvas.save(figure, folder, "robustness")


def _words(row):
    """Success, overspeed where there is any, and the rms error."""
    words = f"{100 * row['success_rate']:.4g} %"
    if row["overspeed_rate"]:
        words += f" ({100 * row['overspeed_rate']:.3g} % over)"
    return words if row["rms_deg"] is None else f"{words}\n{angle(row['rms_deg'])}°"


@canvas.own_style()
def pointing_against_knowledge(rows: Sequence[dict], folder: Path) -> Path:
    """The error of pointing against that of what was believed, where it was not the truth."""
    figure, axis = canvas.subplots(figsize=(7, 5))
    shown = [row for row in rows if row["rms_deg"] and (row["estimate_rms_deg"] or 0) > LEAST_DEG]
    for n, name in enumerate(dict.fromkeys(row["controller"] for row in shown)):
        for how, fill in FILLS.items():
            of_this = [r for r in shown if (r["controller"], way(r)) == (name, how)]
            if not of_this:
                continue
            axis.loglog(
                [row["estimate_rms_deg"] for row in of_this],
                [row["rms_deg"] for row in of_this],
                MARKERS[n % len(MARKERS)],
                color=f"C{n}",
                fillstyle=fill,
                label=name if how == "loop" else f"{name}, {how}",
            )
    ends = np.array(axis.get_xlim())
    axis.plot(ends, ends, color="0.6", linewidth=1, label="pointing as exact as knowledge")
    axis.set_xlabel("rms error of what was believed (°)")
    axis.set_ylabel("rms error of pointing (°)")
    axis.set_title("The last fifth of the slews, a mark for each condition")
    axis.legend(fontsize=8)
    return canvas.save(figure, folder, "pointing_against_knowledge")
