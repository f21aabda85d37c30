"""The rows of a training run's metrics: one a block of updates, and metrics.csv."""

import csv
import io
from pathlib import Path

import numpy as np

from attjax import run_folder

COLUMNS = (
    "agent_steps", "wall_s", "episodes", "episode_return", "episode_return_std",
    "episode_return_n", "success_rate", "overspeed_rate", "terminal_error_deg",
    "entropy", "approximate_kl", "clip_fraction", "policy_loss", "value_loss",
    "explained_variance",
)  # fmt: skip


def block_row(metrics: dict, frameskips: tuple[int, ...], agent_steps: int, wall_s: float) -> dict:
    """One row of metrics.csv from what ``ppo.train_block`` returns for groups of these frameskips.

    Rates and the error are means over all episodes that ended; the return (Eq. 12–13) is
    that of the slowest control rate, the paper's, as returns of several rates do not
    compare. Cells are None where no episode ended.
    """
    sums = {name: np.asarray(x, float) for name, x in metrics["episodes"].items()}
    is_slowest = np.equal(frameskips, max(frameskips))
    episodes, slowest = sums["episodes"].sum(), sums["episodes"][is_slowest].sum()
    row = {"agent_steps": agent_steps, "wall_s": round(wall_s, 2), "episodes": int(episodes)}
    for name in ("success_rate", "overspeed_rate", "terminal_error_deg"):
        row[name] = sums[name].sum() / episodes if episodes else None
    row["episode_return_n"] = int(slowest)
    row["episode_return"] = row["episode_return_std"] = None
    if slowest:
        mean = sums["score"][is_slowest].sum() / slowest
        variance = max(sums["score_squared"][is_slowest].sum() / slowest - mean**2, 0.0)
        row |= {"episode_return": mean, "episode_return_std": variance**0.5}
    return row | {name: float(x) for name, x in metrics["losses"].items()}


class MetricsFile:
    """Appends rows to metrics.csv; each is in the file when ``append`` returns.

    Attributes:
        kept: the rows that were there at its opening, as text.
        wall_s: the clock in the last of them, s.
    """

    def __init__(self, folder: Path, resume_at: int):
        """Open the file, dropping the rows after ``resume_at`` agent steps.

        Raises:
            FolderError: it cannot be read or written, or its rows are no rows of metrics.
        """
        self._folder, self._path = folder, folder / run_folder.METRICS
        rows = read_rows(self._path)
        self.kept = [row for row in rows if int(row["agent_steps"]) <= resume_at]
        self.wall_s = float(self.kept[-1]["wall_s"]) if self.kept else 0.0
        with run_folder.writing(folder):
            run_folder.replace(self._path, _csv_text(self.kept, header=True))

    def append(self, row: dict) -> None:
        """Add one row.

        Raises:
            FolderError: it cannot be written.
        """
        with run_folder.writing(self._folder), self._path.open("a", newline="") as file:
            file.write(_csv_text([cells(row)]))


def read_rows(path: Path) -> list[dict]:
    """The rows of a metrics.csv that need not exist; one that was cut off is left out.

    Raises:
        FolderError: they are no rows of metrics.
    """
    if not path.exists():
        return []
    try:
        lines = path.read_text().splitlines(keepends=True)
        rows = list(csv.DictReader(line for line in lines if line.endswith("\n")))
        for row in rows:
            if set(row) != set(COLUMNS) or None in row.values():
                raise ValueError(f"a row has other columns than {','.join(COLUMNS[:3])}...")
            int(row["agent_steps"])
            [float(cell) for cell in (row["wall_s"], *filter(None, row.values()))]
    except (OSError, ValueError, csv.Error) as error:
        raise run_folder.FolderError(
            f"{path} cannot be read: {error}; without it, the run goes on and begins a new one"
        ) from None
    return rows


def cells(row: dict) -> dict:
    """The row as it stands in the file: floats as text of seven digits."""
    return {name: f"{x:.7g}" if isinstance(x, float) else x for name, x in row.items()}


def _csv_text(rows, header=False):
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    if header:
        writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
