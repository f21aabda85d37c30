"""The panel of a training run on a terminal: a bar, and its newest numbers with their course."""

import math
import time

from rich.console import Console, ConsoleOptions, RenderResult
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from attjax.runs import metrics
from attjax.runs.progress_status import Status

WIDTHS = (25, 16, 24)
"""Of the columns that cells have their places in, without the course that the first one draws."""

GAP = "  "
MOST_TREND, LEAST_BAR = 24, 8
LEVELS = "▁▂▃▄▅▆▇█"


class Panel:
    """The run's state in four lines, for rich; narrow terminals get less of it.

    Args:
        status: what it shows.
        is_stopping: whether the run ends after this block.
    """

    def __init__(self, status: Status, is_stopping: bool = False) -> None:
        self._status, self._is_stopping = status, is_stopping

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The panel's lines, at most two columns narrower than the terminal."""
        width = options.max_width - 2  # Ctrl-C shows as ^C at its end, which must not wrap
        state = self._status.describe(time.monotonic())
        if self._is_stopping:
            state = state[: state.index("ETA")] + "stopping after this block"
        yield _bar(self._status, state, width)
        count = 1 + (width >= sum(WIDTHS[:2]) + len(GAP))
        count += width >= sum(WIDTHS) + 2 * len(GAP)
        free = width - sum(WIDTHS[:count]) - (count - 1) * len(GAP) - 1
        has_blocks = options.encoding.startswith("utf")
        trend_width = max(min(free, MOST_TREND), 0) if has_blocks else 0
        placed = {metric.cell.place: metric for metric in metrics.METRICS if metric.cell}
        rows = 1 + max(row for _, row in placed)
        first = [placed.get((0, row)) for row in range(rows)]
        for row, text in enumerate(_first_cells(self._status, first, trend_width)):
            for column in range(1, count):
                text.append(GAP)
                text.append_text(_cell(self._status, placed.get((column, row)), WIDTHS[column]))
            text.truncate(width)
            yield text


def _bar(status, state, width):
    text = _text(state)
    text.truncate(width)
    if width < len(state) + LEAST_BAR + 2:
        return text
    bar = ProgressBar(status.total, min(status.steps, status.total), width - len(state) - 2)
    grid = Table.grid(padding=(0, 2, 0, 0))
    grid.add_row(bar, text)
    return grid


def _first_cells(status, column, trend_width):
    if not status.has_episodes:
        width = WIDTHS[0] + (trend_width + 1 if trend_width else 0)
        words: tuple[str, ...] = ("no whole episode", "has ended yet")
        if not status.has_blocks:
            words = ("the first block runs",)
        blank = ("",) * (len(column) - len(words))
        yield from (_text(word.ljust(width)) for word in (*words, *blank))
        return
    for metric in column:
        text = _cell(status, metric, WIDTHS[0])
        if trend_width:
            values = status.history[metric.name] if metric else []
            text.append(" " + trend(values, trend_width), "cyan")
        yield text


def _cell(status, metric, width):
    if metric is None:
        return _text(" " * width)
    label = metric.cell.label
    return _text(label, "dim").append(status.shown(metric).rjust(width - len(label)))


def _text(content, style=""):
    return Text(no_wrap=True, overflow="crop").append(content, style)


def trend(values: list[float], width: int) -> str:
    """The values over the whole run as ``width`` blocks, from the least to the greatest.

    Positive values that span a factor of ten or more are drawn by their logarithm.

    Example:
        >>> trend([1, 2, 3, 4, 5, 6, 7, 8], 4)
        '▁▃▅█'
    """
    values = [x for x in values if math.isfinite(x)]
    count = min(width, len(values))
    shown = [values[(i + 1) * len(values) // count - 1] for i in range(count)]
    if shown and min(shown) > 0 and max(shown) >= 10 * min(shown):
        shown = [math.log(x) for x in shown]
    low, high = min(shown, default=0), max(shown, default=0)
    span = (high - low) or 1
    levels = [int((x - low) / span * (len(LEVELS) - 1)) for x in shown]
    return "".join(LEVELS[level] for level in levels).ljust(width)
