"""How a training run shows itself: a panel that redraws itself on a terminal, lines elsewhere."""

import collections
import time

from rich.console import Console
from rich.live import Live

from attjax import panel

WINDOW_S = 60.0
"""Speed and remaining time come from the blocks of so many seconds."""

REDRAWS_PER_S = 2
LEAST_PAUSE_S, PAUSE_SHARE = 5.0, 0.01
"""Between two lines: so long, and that share of the time before; so a day makes some 600 lines."""

NONE_YET = "no whole episode has ended yet"


class Progress:
    """Shows a run while it trains; a context manager.

    On a terminal it is a panel of four lines, whose last state stays. Elsewhere it prints a line
    for the first and the last block, and between them not more often than is read.

    Args:
        total_steps: agent steps of the whole run.
        done_steps: those done before; the clock starts when the context is entered.
        rows: of metrics.csv, of a run that goes on.
        stop: has ``received``, not None once the run has been asked to stop.
    """

    def __init__(self, total_steps: int, done_steps: int, rows=(), stop=None):
        self._status = Status(total_steps, done_steps)
        for row in rows:
            self._status.learn({name: float(cell) for name, cell in row.items() if cell})
        self._stop, self._console = stop, Console(highlight=False)
        # Not for rich alone to say: it also takes a log for a terminal where FORCE_COLOR is set.
        self._is_live = self._console.is_interactive and self._console.file.isatty()
        self._live = Live(self, console=self._console, refresh_per_second=REDRAWS_PER_S)
        self._is_shown, self._next_line = True, 0.0

    def __enter__(self):
        self._start = time.monotonic()
        self._status.start(self._start)
        if self._is_live:
            self._live.start()
            # A process that is killed at once could not bring a hidden cursor back.
            self._console.show_cursor(True)
        return self

    def __exit__(self, *_):
        if self._is_live:
            self._live.stop()
        elif not self._is_shown:
            self._print()

    def show(self, row: dict) -> None:
        """Show a row of metrics."""
        now = time.monotonic()
        self._status.add(row, now)
        self._is_shown = False
        if not self._is_live and now >= self._next_line:
            self._print()
            self._next_line = now + max(LEAST_PAUSE_S, PAUSE_SHARE * (now - self._start))

    def _print(self):
        print(line(self._status, time.monotonic()), file=self._console.file, flush=True)
        self._is_shown = True

    def __rich__(self):
        is_stopping = self._stop is not None and self._stop.received is not None
        return panel.Panel(self._status, is_stopping)


class Status:
    """What the rows so far say of a run.

    Attributes:
        known: the newest value of each column that has had one.
        history: all values, of the columns that the panel draws.
    """

    def __init__(self, total_steps: int, done_steps: int):
        self.total, self.steps, self.known = total_steps, done_steps, {}
        self.history = {name: [] for _, name, _ in panel.EPISODE_COLUMN}
        self._marks = collections.deque()

    def start(self, now: float) -> None:
        """Start the clock."""
        self._marks.append((now, self.steps))

    def add(self, row: dict, now: float) -> None:
        """Take in a row of metrics."""
        self.steps = row["agent_steps"]
        self.learn({name: value for name, value in row.items() if value is not None})
        self._marks.append((now, self.steps))
        while self._marks[1][0] < now - WINDOW_S and len(self._marks) > 2:
            self._marks.popleft()

    def learn(self, values: dict) -> None:
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


def line(status: Status, now: float) -> str:
    """The run's state in a line; what is not known is left out."""
    parts = [f"{status.describe(now):<44}"]
    if "episodes" in status.known and "success_rate" not in status.known:
        parts.append(NONE_YET)
    for label, name, form in (*panel.EPISODE_COLUMN, panel.UPDATE_COLUMNS[0][0]):
        if name in status.known:
            parts.append(f"{label} {panel.value(status, name, form)}")
    return "  ".join(parts)


def _short(x):
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


def _duration(seconds):
    """Hours, minutes and seconds.

    Example:
        >>> _duration(59.7), _duration(3723)
        ('1:00', '1:02:03')
    """
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{seconds:02}" if hours else f"{minutes}:{seconds:02}"
