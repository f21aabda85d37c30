"""How a training run shows itself: a live line, or plain lines."""

import time

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

WIDTH_FOR_BAR = 100


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
