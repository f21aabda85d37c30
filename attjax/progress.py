"""How a training run shows itself: a live line, or plain lines, and metrics.csv."""

import csv
import io
import time
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from attjax import run_folder

WIDTH_FOR_BAR = 100
COLUMNS = (
    "agent_steps", "wall_s", "episodes", "episode_return", "episode_return_std",
    "episode_return_n", "success_rate", "overspeed_rate", "terminal_error_deg",
    "entropy", "approximate_kl", "clip_fraction", "policy_loss", "value_loss",
    "explained_variance",
)  # fmt: skip


def metrics_row(metrics: dict, agent_steps: int, wall_s: float) -> dict:
    """One row of metrics.csv from what ``ppo.train_block`` returns.

    Rates and the error are means over all episodes that ended; the return (Eq. 12–13) is
    that of the slowest control rate, the paper's, as returns of several rates do not
    compare. Cells are None where no episode ended.
    """
    sums = {name: np.asarray(x, float) for name, x in metrics["episodes"].items()}
    episodes, slowest = sums["episodes"].sum(), sums["episodes"][-1]
    row = {"agent_steps": agent_steps, "wall_s": round(wall_s, 2), "episodes": int(episodes)}
    for name in ("success_rate", "overspeed_rate", "terminal_error_deg"):
        row[name] = sums[name].sum() / episodes if episodes else None
    row["episode_return_n"] = int(slowest)
    row["episode_return"] = row["episode_return_std"] = None
    if slowest:
        mean = sums["score"][-1] / slowest
        variance = max(sums["score_squared"][-1] / slowest - mean**2, 0.0)
        row |= {"episode_return": mean, "episode_return_std": variance**0.5}
    return row | {name: float(x) for name, x in metrics["losses"].items()}


class MetricsFile:
    """Appends rows to metrics.csv; each is in the file when ``append`` returns."""

    def __init__(self, folder: Path, resume_at: int):
        """Open the file, dropping the rows after ``resume_at`` agent steps.

        Raises:
            FolderError: it cannot be read or written, or its rows are no rows of metrics.
        """
        self._folder, self._path = folder, folder / run_folder.METRICS
        rows = [row for row in read_rows(self._path) if int(row["agent_steps"]) <= resume_at]
        self.wall_s = float(rows[-1]["wall_s"]) if rows else 0.0
        with run_folder.writing(folder):
            run_folder.replace(self._path, _csv_text(rows, header=True))

    def append(self, row: dict) -> None:
        """Add one row.

        Raises:
            FolderError: it cannot be written.
        """
        with run_folder.writing(self._folder), self._path.open("a", newline="") as file:
            file.write(_csv_text([{k: _cell(v) for k, v in row.items()}]))


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


def _cell(value):
    return f"{value:.7g}" if isinstance(value, float) else value


def _csv_text(rows, header=False):
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    if header:
        writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


class ProgressLine:
    """A live progress line on a terminal, plain lines elsewhere; a context manager."""

    def __init__(self, total_steps: int, done_steps: int):
        self._total, self._start_steps = total_steps, done_steps
        console = Console(highlight=False)
        self._is_live = console.is_terminal
        bar = [BarColumn(bar_width=None)] if console.width >= WIDTH_FOR_BAR else []
        columns = [*bar, TextColumn("{task.fields[text]}")]
        self._progress = Progress(*columns, console=console, expand=True)
        self._task = self._progress.add_task(
            "", total=total_steps, completed=done_steps, text="first block"
        )

    def __enter__(self):
        self._start = time.monotonic()
        if self._is_live:
            self._progress.start()
        return self

    def __exit__(self, *exception):
        if self._is_live:
            self._progress.stop()

    def show(self, row: dict) -> None:
        """Show a row of metrics."""
        steps, elapsed = row["agent_steps"], time.monotonic() - self._start
        rate = (steps - self._start_steps) / max(elapsed, 1e-9)
        minutes, seconds = divmod(round((self._total - steps) / rate), 60)
        text = (
            f"{steps / 1e6:.3g}/{self._total / 1e6:.3g}M steps {_thousands(rate)}/s "
            f"ETA {minutes}:{seconds:02}  return {_number(row['episode_return'], '.0f')} "
            f"success {_number(row['success_rate'], '.1%')} "
            f"error {_number(row['terminal_error_deg'], '.3g')}°"
        )
        self._progress.update(self._task, completed=steps, text=text)
        if not self._is_live:
            print(text, flush=True)


def _number(value, form):
    return "–" if value is None else format(value, form)


def _thousands(rate):
    return f"{rate / 1e3:.0f}k" if rate >= 1e4 else f"{rate:.0f}"
