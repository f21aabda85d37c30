"""How a training run shows itself: a panel that redraws itself on a terminal, lines elsewhere."""

import time
from collections.abc import Iterable
from typing import Any, Self

from rich.console import Console
from rich.live import Live

from attjax.runs.progress_panel import Panel
from attjax.runs.progress_status import Status, line
from attjax.runs.signals import StopSignals

REDRAWS_PER_S = 2
LEAST_PAUSE_S, PAUSE_SHARE = 5.0, 0.01
"""Between two lines: so long, and that share of the time before; so a day makes some 600 lines."""


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

    def __init__(
        self,
        total_steps: int,
        done_steps: int,
        rows: Iterable[dict[str, str]] = (),
        stop: StopSignals | None = None,
    ) -> None:
        self._status = Status(total_steps, done_steps)
        for row in rows:
            self._status.learn({name: float(cell) for name, cell in row.items() if cell})
        self._stop, self._console = stop, Console(highlight=False)
        # Not for rich alone to say: it also takes a log for a terminal where FORCE_COLOR is set.
        self._is_live = self._console.is_interactive and self._console.file.isatty()
        self._live = Live(self, console=self._console, refresh_per_second=REDRAWS_PER_S)
        self._is_shown, self._next_line = True, 0.0

    def __enter__(self) -> Self:
        self._start = time.monotonic()
        self._status.start(self._start)
        if self._is_live:
            self._live.start()
            # A process that is killed at once could not bring a hidden cursor back.
            self._console.show_cursor(True)
        return self

    def __exit__(self, *_: object) -> None:
        if self._is_live:
            self._live.stop()
        elif not self._is_shown:
            self._print()

    def show(self, row: dict[str, Any]) -> None:
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

    def __rich__(self) -> Panel:
        is_stopping = self._stop is not None and self._stop.received is not None
        return Panel(self._status, is_stopping)
