"""The figure of a run's learning curve, from its metrics.csv. Needs the extra ``plot``."""

from pathlib import Path

from attjax import canvas
from attjax.runs import metrics

PAPERS_PLATEAU = 2500


def write(rows: list[dict[str, str]], is_the_papers: bool, folder: Path) -> list[Path]:
    """Write the learning curve into the folder where there is one to draw; returns its path.

    Args:
        rows: of metrics.csv, as text. A short run ends before an episode does, and then they say
            nothing of any.
        is_the_papers: whether the paper's results can stand beside the run's.
        folder: there is.
    """
    rows = [row for row in rows if row["episode_return"]]
    return [_draw(rows, is_the_papers, folder)] if rows else []


@canvas.own_style()
def _draw(rows, is_the_papers, folder):
    steps = [int(row["agent_steps"]) / 1e6 for row in rows]
    drawn = [(metric.name, metric.curve) for metric in metrics.METRICS if metric.curve]
    figure, axes = canvas.subplots(len(drawn), 1, figsize=(7, 7 / 3 * len(drawn)), sharex=True)
    for axis, (name, curve) in zip(axes, drawn):
        axis.plot(steps, [float(row[name] or "nan") for row in rows], "k", linewidth=1)
        axis.set_ylabel(curve.label)
        axis.grid(alpha=0.3)
        if is_the_papers and name == "episode_return":
            axis.axhline(
                PAPERS_PLATEAU, color="tab:red", linestyle="--", label="the paper's plateau"
            )
            axis.legend()
        if curve.is_log:
            axis.set_yscale("log")
    axes[-1].set_xlabel("agent steps (millions)")
    axes[0].set_title("Learning: training episodes")
    return canvas.save(figure, folder, "learning_curve")
