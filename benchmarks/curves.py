"""Learning curves of several runs in one figure, beside the paper's plateau.

Each point is the mean over as many agent steps as every other. Needs the extra plot.

Example:
    python benchmarks/curves.py runs/paper runs/paper-gae --plot curves.png
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


def parse_arguments(argv=None):
    """The command line."""
    parser = command_line.Parser(description=__doc__)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="folder of a run")
    labels_help = "what the figure calls each run (default: its folder's name)"
    parser.add_argument("--labels", nargs="+", metavar="TEXT", help=labels_help)
    parser.add_argument(
        "--plot", type=common.writable_file, metavar="FILE", required=True, help="the figure (PNG)"
    )
    return parser.parse_args(argv)


def curve(rows: list[dict[str, str]], part: float) -> dict[str, np.ndarray]:
    """Means over whole parts of so many agent steps, of the rows in which an episode ended.

    Returns:
        "agent_steps" at the parts' ends, "episode_return" and "success_rate".
    """
    names = "agent_steps", "episode_return", "success_rate"
    columns = np.array([[float(row[name] or "nan") for name in names] for row in rows])
    columns = columns[np.isfinite(columns[:, 1])]
    number = np.ceil(columns[:, 0] / part)
    whole = np.unique(number)[:-1] if columns[-1, 0] < number[-1] * part else np.unique(number)
    parts = [columns[number == n] for n in whole]
    means = np.array([[part[-1, 0], *part[:, 1:].mean(axis=0)] for part in parts])
    return dict(zip(names, means.T))


@canvas.own_style()
def draw(curves: dict[str, dict[str, np.ndarray]], path: Path) -> None:
    """Return and success of the exploring policies against agent steps."""
    figure, (returns, successes) = canvas.subplots(2, figsize=(8, 7), sharex=True)
    for label, values in curves.items():
        steps = values["agent_steps"] / 1e6
        returns.plot(steps, values["episode_return"], label=label)
        successes.plot(steps, 100 * values["success_rate"])
    style = {"color": "0.4", "linestyle": "--", "linewidth": 1}
    returns.axhline(PAPERS_PLATEAU, label="the paper's plateau", **style)
    returns.set_ylabel("return (Eq. 12–13)")
    successes.set(ylabel="success (%)", xlabel="agent steps (millions)", xscale="log")
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
        part = max(float(run[-1]["agent_steps"]) for run in rows) / POINTS
        draw(dict(zip(labels, (curve(run, part) for run in rows))), arguments.plot)
    print(f"wrote {arguments.plot}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
