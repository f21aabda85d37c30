"""How soon runs reach the paper's plateau and what they end with; their learning curves.

Returns and successes are those of the exploring policy: means over the whole episodes that ended
in the last so many agent steps.

Example:
    python benchmarks/curves.py runs/paper runs/paper-gae
    python benchmarks/curves.py runs/paper runs/paper-gae --plot curves.png    # extra plot
"""

import sys
from pathlib import Path

import common
import numpy as np

from attjax import canvas, errors
from attjax.config import command_line
from attjax.runs import folder as run_folder
from attjax.runs import metrics_file
from attjax.runs.learning_curve import PAPERS_PLATEAU

POINTS = 100
"""Of the longest run."""

COLUMNS = ["run", "agent steps", "plateau after", "return", "success (%)"]


def parse_arguments(argv=None):
    """The command line."""
    parser = command_line.Parser(description=__doc__)
    parser.add_argument(
        "runs", nargs="+", type=command_line.path, metavar="RUN", help="folder of a run"
    )
    labels_help = "what each run is called (default: its folder's name)"
    parser.add_argument("--labels", nargs="+", metavar="TEXT", help=labels_help)
    over_help = "agent steps to take means over (default: a hundredth of the longest run's)"
    command_line.add_number(parser, "mean-over", int, None, over_help, low=1)
    parser.add_argument(
        "--plot", type=common.writable_file, metavar="FILE", help="draw the curves there (PNG)"
    )
    return parser.parse_args(argv)


def averaged(rows: list[dict[str, str]], part: float) -> dict[str, np.ndarray]:
    """Means over the last ``part`` agent steps, from where there are as many.

    Returns:
        "agent_steps", "episode_return" and "success_rate"; rows in which no episode ended are
        left out.
    """
    columns = metrics_file.arrays(rows)
    ended = columns["episodes"] > 0
    steps, weights = columns["agent_steps"][ended], columns["episodes"][ended]
    first = np.searchsorted(steps, steps - part, side="right")

    def sums(x):
        up_to = np.concatenate([[0.0], np.cumsum(x)])
        return up_to[1:] - up_to[first]

    means = {
        name: sums(weights * columns[name][ended]) / sums(weights)
        for name in ("episode_return", "success_rate")
    }
    return {name: x[steps >= part] for name, x in {"agent_steps": steps, **means}.items()}


def table_row(label: str, means: dict[str, np.ndarray]) -> list[str]:
    """The row of COLUMNS of a run."""
    steps = means["agent_steps"]
    there = np.flatnonzero(means["episode_return"] >= PAPERS_PLATEAU)
    return [
        label,
        common.rate(steps[-1]),
        common.rate(steps[there[0]]) if len(there) else "not",
        f"{means['episode_return'][-1]:,.0f}",
        f"{100 * means['success_rate'][-1]:.1f}",
    ]


@canvas.own_style()
def draw(curves: dict[str, dict[str, np.ndarray]], part: float, path: Path) -> None:
    """Return and success of the exploring policies against agent steps, at each whole part."""
    figure, (returns, successes) = canvas.subplots(2, figsize=(8, 7), sharex=True)
    for label, means in curves.items():
        steps = means["agent_steps"]
        points = np.searchsorted(steps, np.arange(1, steps[-1] // part + 1) * part)
        returns.plot(steps[points] / 1e6, means["episode_return"][points], label=label)
        successes.plot(steps[points] / 1e6, 100 * means["success_rate"][points])
    style = {"color": "0.4", "linestyle": "--", "linewidth": 1}
    returns.axhline(PAPERS_PLATEAU, label="the paper's plateau", **style)
    returns.set_ylabel("return (Eq. 12–13)")
    successes.set(ylabel="success (%)", xlabel="agent steps (millions)", xscale="log")
    successes.xaxis.set_major_formatter("{x:g}")
    for axis in (returns, successes):
        axis.grid(alpha=0.3)
    figure.suptitle("The exploring policy during training, at 11.43 Hz")
    figure.legend(loc="outside lower center", ncols=2)
    figure.savefig(path, dpi=150)


@errors.program("curves.py")
def main(argv=None) -> int:
    """Draw; returns the exit status."""
    arguments = parse_arguments(argv)
    labels = arguments.labels or [path.resolve().name for path in arguments.runs]
    with errors.one_line_errors():
        if len(labels) != len(set(labels)) or len(labels) != len(arguments.runs):
            raise errors.UserError("--labels must be as many as there are runs, and all different")
        rows = [metrics_file.read_rows(path / run_folder.METRICS) for path in arguments.runs]
        if not all(any(row["episode_return"] for row in run) for run in rows):
            raise errors.UserError("no episode ended in one of the runs")
        longest = max(float(run[-1]["agent_steps"]) for run in rows)
        part = arguments.mean_over or longest / POINTS
        curves = dict(zip(labels, (averaged(run, part) for run in rows)))
        if not all(len(means["agent_steps"]) for means in curves.values()):
            raise errors.UserError(f"--mean-over: a run is shorter than {part:g} agent steps")
    common.print_table(COLUMNS, [table_row(*named) for named in curves.items()])
    print(f"\nmeans over {part:,.0f} agent steps; the plateau is {PAPERS_PLATEAU:,}")
    if arguments.plot:
        draw(curves, part, arguments.plot)
        print(f"wrote {arguments.plot}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
