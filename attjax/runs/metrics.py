"""The metrics of a training run: which there are, and a row of them a block of updates.

``METRICS`` says all that is told of a metric anywhere: its column, its cell of the panel, its curve
in TensorBoard and in the figure. Another one is an entry there, and its number where numbers are
made: an outcome of the environment, which ``rollout.episode_sums`` adds up, or a loss.
"""

import dataclasses
from typing import Any

import numpy as np


@dataclasses.dataclass(frozen=True)
class Cell:
    """What the panel shows of a metric.

    Attributes:
        label: its name for people.
        form: format of its newest value, with its unit.
        place: column and row. The first column's are drawn with their course, too; where the
            terminal is narrow, the last ones are left out.
        is_in_line: whether the lines of a log show it, too.
    """

    label: str
    form: str
    place: tuple[int, int]
    is_in_line: bool = False


@dataclasses.dataclass(frozen=True)
class Curve:
    """An axis of the figure of the learning curve: its label, and whether it is logarithmic."""

    label: str
    is_log: bool = False


@dataclasses.dataclass(frozen=True, kw_only=True)
class Metric:
    """A column of metrics.csv, and where else it appears.

    Attributes:
        name: of the column.
        meaning, unit: its row in docs/logs.md.
        mean_of: the sum of a block's "episodes" that it is the mean of, over the whole episodes
            that ended; None where ``block_row`` finds it ready, as a loss.
        is_of_slowest: whether over those at the slowest control rate only.
        tag: of its curve in TensorBoard; None for what every curve is drawn against.
        is_compared: whether it stands beside the settings in TensorBoard's tab HPARAMS.
        cell, curve: on the panel, and in the figure of the learning curve.
    """

    name: str
    meaning: str
    unit: str = ""
    mean_of: str | None = None
    is_of_slowest: bool = False
    tag: str | None = None
    is_compared: bool = False
    cell: Cell | None = None
    curve: Curve | None = None

    @property
    def is_drawn(self) -> bool:
        """Whether the panel draws its course."""
        return self.cell is not None and self.cell.place[0] == 0


METRICS = (
    Metric(name="agent_steps", meaning="agent steps done, over all spacecraft"),
    Metric(
        name="wall_s", unit="s", tag="time/wall_s",
        meaning="training time, without compilation and without the pauses between a stop and "
        "`--resume`",
    ),
    Metric(
        name="episodes", tag="episode/ended",
        meaning="whole episodes that ended in the block",
    ),
    Metric(
        name="episode_return", mean_of="score", is_of_slowest=True,
        meaning="mean return of Eq. 12–13 at the slowest control rate, the paper's, whatever the "
        "reward learned from",
        tag="episode/return", is_compared=True,
        cell=Cell("return", "{:,.0f}", (0, 0), is_in_line=True), curve=Curve("return (Eq. 12–13)"),
    ),
    Metric(
        name="episode_return_std", tag="episode/return_std",
        meaning="its standard deviation over those episodes",
    ),
    Metric(name="episode_return_n", tag="episode/return_n", meaning="their number"),
    Metric(
        name="success_rate", unit="0 to 1", mean_of="success_rate",
        meaning="share of the episodes that ended within 0.25° and never passed 0.5 rad/s",
        tag="episode/success_rate", is_compared=True,
        cell=Cell("success", "{:.1%}", (0, 1), is_in_line=True), curve=Curve("success rate"),
    ),
    Metric(
        name="overspeed_rate", unit="0 to 1", mean_of="overspeed_rate",
        meaning="share that passed 0.5 rad/s",
        tag="episode/overspeed_rate", is_compared=True, cell=Cell("overspeed", "{:.1%}", (2, 2)),
    ),
    Metric(
        name="terminal_error_deg", unit="°", mean_of="terminal_error_deg",
        meaning="mean error angle at the end",
        tag="episode/terminal_error_deg", is_compared=True,
        cell=Cell("terminal error", "{:.3g}°", (0, 2), is_in_line=True),
        curve=Curve("terminal error (°)", is_log=True),
    ),
    Metric(
        name="entropy", unit="nat", tag="policy/entropy",
        meaning="mean entropy of the policy; 19 equal actions have 2.94",
        cell=Cell("entropy", "{:.3g}", (1, 0), is_in_line=True),
    ),
    Metric(
        name="approximate_kl", unit="nat", tag="policy/approximate_kl",
        meaning="mean change of the policy in an update, Kullback–Leibler",
        cell=Cell("KL", "{:.2g}", (1, 1)),
    ),
    Metric(
        name="clip_fraction", unit="0 to 1", tag="policy/clip_fraction",
        meaning="share of the samples beyond the clipping parameter ε",
        cell=Cell("clipped", "{:.1%}", (1, 2)),
    ),
    Metric(
        name="policy_loss", tag="loss/policy",
        meaning="mean of −L^CLIP of Eq. 4, without the entropy bonus",
    ),
    Metric(
        name="value_loss", tag="loss/value",
        meaning="mean squared error of the value network, in scaled rewards",
        cell=Cell("value loss", "{:.3g}", (2, 0)),
    ),
    Metric(
        name="explained_variance", tag="loss/explained_variance",
        meaning="1 − variance of its error over variance of its target; 1 is perfect, 0 no better "
        "than a constant",
        cell=Cell("explained var.", "{:.3g}", (2, 1)),
    ),
)  # fmt: skip
"""In the order of the columns of metrics.csv."""


def columns() -> tuple[str, ...]:
    """The columns of metrics.csv."""
    return tuple(metric.name for metric in METRICS)


def block_row(
    block: dict[str, Any], frameskips: tuple[int, ...], agent_steps: int, wall_s: float
) -> dict[str, Any]:
    """One row of metrics.csv from what ``ppo.train_block`` returns for groups of these frameskips.

    Rates and the error are means over all episodes that ended; the return (Eq. 12–13) is
    that of the slowest control rate, the paper's, as returns of several rates do not
    compare. Cells are None where no episode ended.
    """
    sums = {name: np.asarray(x, float) for name, x in block["episodes"].items()}
    is_slowest = np.equal(frameskips, max(frameskips))
    slowest = {name: x[is_slowest] for name, x in sums.items()}
    row: dict[str, Any] = {"agent_steps": agent_steps, "wall_s": round(wall_s, 2)}
    row |= {"episodes": int(sums["episodes"].sum())}
    row |= {m.name: _mean(sums, m.mean_of) for m in METRICS if m.mean_of and not m.is_of_slowest}
    row |= {"episode_return_n": int(slowest["episodes"].sum())}
    row |= {m.name: _mean(slowest, m.mean_of) for m in METRICS if m.is_of_slowest}
    row |= {"episode_return_std": _deviation(slowest, "score")}
    return row | {name: float(x) for name, x in block["losses"].items()}


def _mean(sums, name):
    episodes = sums["episodes"].sum()
    return sums[name].sum() / episodes if episodes else None


def _deviation(sums, name):
    mean, mean_square = _mean(sums, name), _mean(sums, f"{name}_squared")
    return None if mean is None else max(mean_square - mean**2, 0.0) ** 0.5
