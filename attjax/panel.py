"""The panel of a training run on a terminal: a bar, and its newest numbers with their course."""

import math
import time

from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

EPISODE_COLUMN = (
    ("return", "episode_return", ",.0f"),
    ("success", "success_rate", ".1%"),
    ("terminal error", "terminal_error_deg", ".3g"),
)
UPDATE_COLUMNS = (
    (
        ("entropy", "entropy", ".3g"),
        ("KL", "approximate_kl", ".2g"),
        ("clipped", "clip_fraction", ".1%"),
    ),
    (
        ("value loss", "value_loss", ".3g"),
        ("explained var.", "explained_variance", ".3g"),
        ("overspeed", "overspeed_rate", ".1%"),
    ),
)
"""What the panel shows: label, column of metrics.csv, format."""

WIDTHS = (25, 16, 24)
GAP = "  "
MOST_TREND, LEAST_BAR = 24, 8
LEVELS = "▁▂▃▄▅▆▇█"


class Panel:
    """The run's state in four lines, for rich; narrow terminals get less of it.

    Args:
        status: a ``progress.Status``.
        is_stopping: whether the run ends after this block.
    """

    def __init__(self, status, is_stopping: bool = False):
        self._status, self._is_stopping = status, is_stopping

    def __rich_console__(self, console, options):
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
        for row, text in enumerate(_episode_cells(self._status, trend_width)):
            for column, size in zip(UPDATE_COLUMNS[: count - 1], WIDTHS[1:]):
                text.append(GAP)
                text.append_text(_cell(self._status, column[row], size))
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


def _episode_cells(status, trend_width):
    if "success_rate" not in status.known:
        width = WIDTHS[0] + (trend_width + 1 if trend_width else 0)
        words = ("no whole episode", "has ended yet", "")
        if "episodes" not in status.known:
            words = ("the first block runs", "", "")
        yield from (_text(word.ljust(width)) for word in words)
        return
    for entry in EPISODE_COLUMN:
        text = _cell(status, entry, WIDTHS[0])
        if trend_width:
            text.append(" " + trend(status.history[entry[1]], trend_width), "cyan")
        yield text


def _cell(status, entry, width):
    label, name, form = entry
    shown = value(status, name, form)
    return _text(label, "dim").append(shown.rjust(width - len(label)))


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


def value(status, name: str, form: str) -> str:
    """The newest value of a column, with its unit; a dash where there is none."""
    unit = "°" if name.endswith("_deg") else ""
    return format(status.known[name], form) + unit if name in status.known else "–"
