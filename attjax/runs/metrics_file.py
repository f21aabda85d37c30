"""metrics.csv: the rows of a training run's metrics, one a block of updates."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from attjax.runs import folder as run_folder
from attjax.runs import metrics

NEEDED = {"agent_steps", "wall_s"}
"""Columns that every row has had from the first version on; those that came later may lack."""


class MetricsFile:
    """Appends rows to metrics.csv; each is in the file when ``append`` returns.

    Attributes:
        kept: the rows that were there at its opening, as text.
        wall_s: the clock in the last of them, s.
    """

    def __init__(self, folder: Path, resume_at: int) -> None:
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

    def append(self, row: dict[str, Any]) -> None:
        """Add one row.

        Raises:
            FolderError: it cannot be written.
        """
        with run_folder.writing(self._folder), self._path.open("a", newline="") as file:
            file.write(_csv_text([cells(row)]))


def read_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a metrics.csv that need not exist; one that was cut off is left out.

    Columns that an earlier version did not have are empty.

    Raises:
        FolderError: they are no rows of metrics.
    """
    if not path.exists():
        return []
    columns = metrics.columns()
    try:
        lines = path.read_text().splitlines(keepends=True)
        rows = list(csv.DictReader(line for line in lines if line.endswith("\n")))
        for row in rows:
            if not NEEDED <= set(row) <= set(columns) or None in row.values():
                raise ValueError(f"a row has other columns than {','.join(columns[:3])}...")
            int(row["agent_steps"])
            [float(cell) for cell in (row["wall_s"], *filter(None, row.values()))]
    except (OSError, ValueError, csv.Error) as error:
        raise run_folder.FolderError(
            f"{path} cannot be read: {error}; without it, the run goes on and begins a new one"
        ) from None
    return [dict.fromkeys(columns, "") | row for row in rows]


def cells(row: dict[str, Any]) -> dict[str, Any]:
    """The row as it stands in the file: floats as text of seven digits."""
    return {name: f"{x:.7g}" if isinstance(x, float) else x for name, x in row.items()}


def arrays(rows: list[dict[str, Any]]) -> dict[str, np.ndarray]:
    """The columns of rows as arrays, float64, NaN where a cell is empty.

    Example:
        >>> arrays([{"agent_steps": 64, "entropy": "2.5"}, {"agent_steps": 128}])["entropy"]
        array([2.5, nan])
    """
    return {
        name: np.array([_number(row.get(name)) for row in rows], float)
        for name in metrics.columns()
    }


def _number(cell):
    return float("nan") if cell in (None, "") else float(cell)


def _csv_text(rows, header=False):
    text = io.StringIO()
    writer = csv.DictWriter(text, metrics.columns(), lineterminator="\n")
    if header:
        writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
