"""What the rows so far say of a training run, and a line that tells it."""

import collections
from typing import Any

from attjax.runs import metrics
from attjax.runs.metrics import Metric

WINDOW_S = 60.0
"""Speed and remaining time come from the blocks of so many seconds."""

NONE_YET = "no whole episode has ended yet"


class Status:
    """What the rows so far say of a run.

    Attributes:
        total, steps: agent steps of the whole run, and those done.
        known: the newest value of each column that has had one.
        history: all values, of the columns that the panel draws.
    """

    def __init__(self, total_steps: int, done_steps: int) -> None:
        self.total, self.steps = total_steps, done_steps
        self.known: dict[str, float] = {}
        self.history: dict[str, list[float]] = {
            metric.name: [] for metric in metrics.METRICS if metric.is_drawn
        }
        self._marks: collections.deque[tuple[float, int]] = collections.deque()

    @property
    def has_blocks(self) -> bool:
        """Whether a block has ended."""
        return "episodes" in self.known

    @property
    def has_episodes(self) -> bool:
        """Whether a whole episode has ended."""
        return "success_rate" in self.known

    def start(self, now: float) -> None:
        """Start the clock."""
        self._marks.append((now, self.steps))

    def add(self, row: dict[str, Any], now: float) -> None:
        """Take in a row of metrics."""
        self.steps = row["agent_steps"]
        self.learn({name: value for name, value in row.items() if value is not None})
        self._marks.append((now, self.steps))
        while self._marks[1][0] < now - WINDOW_S and len(self._marks) > 2:
            self._marks.popleft()

    def learn(self, values: dict[str, float]) -> None:
        """Take in what is not empty in a row."""
        self.known |= values
        for name in self.history.keys() & values.keys():
            self.history[name].append(values[name])

    def describe(self, now: float) -> str:
        """Where it stands, how fast it is and how long it will take."""
        (since, steps), (until, _) = self._marks[0], self._marks[-1]
        speed = remaining = "–"
        if self.steps > steps and until > since:
            rate = (self.steps - steps) / (until - since)
            speed = _short(rate)
            remaining = _duration(max((self.total - self.steps) / rate - (now - until), 0))
        done = f"{self.steps / self.total:.1%}  {_short(self.steps)}/{_short(self.total)} steps"
        return f"{done}  {speed}/s  ETA {remaining}"

    def shown(self, metric: Metric) -> str:
        """The newest value of a metric as the panel shows it; a dash where there is none."""
        if metric.cell is None or metric.name not in self.known:
            return "–"
        return metric.cell.form.format(self.known[metric.name])


def line(status: Status, now: float) -> str:
    """The run's state in a line; what is not known is left out."""
    parts = [f"{status.describe(now):<44}"]
    if status.has_blocks and not status.has_episodes:
        parts.append(NONE_YET)
    for metric in metrics.METRICS:
        if metric.cell and metric.cell.is_in_line and metric.name in status.known:
            parts.append(f"{metric.cell.label} {status.shown(metric)}")
    return "  ".join(parts)


def _short(x: float) -> str:
    """Three digits and a unit.

    Example:
        >>> [_short(x) for x in (256, 999_900, 40_000_000)]
        ['256', '1M', '40M']
    """
    for scale, unit in ((1, ""), (1e3, "k"), (1e6, "M"), (1e9, "G")):
        text = f"{x / scale:.3g}"
        if float(text) < 1000:
            return text + unit
    return f"{x / 1e12:.3g}T"


def _duration(seconds: float) -> str:
    """Hours, minutes and seconds.

    Example:
        >>> _duration(59.7), _duration(3723)
        ('1:00', '1:02:03')
    """
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
