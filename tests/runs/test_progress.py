"""How a run shows itself: the panel at several widths, lines elsewhere, numbers of any kind."""

import io
import math
import os
import pty
import re
import signal
import subprocess
import sys
import time

import pytest
from commands import ROOT
from rich.console import Console
from rows import EPISODES, LOSSES, row

from attjax.runs import progress, progress_panel, progress_status

WORST = dict.fromkeys((*LOSSES, *EPISODES), -1.2345e-05)


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still unless it is moved: [seconds]."""
    now = [1000.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def status(*rows, total=40_000_000):
    made = progress_status.Status(total, 0)
    made.start(1000.0)
    for i, each in enumerate(rows):
        made.add(each, 1000.0 + i + 1)
    return made


def screen(view, width):
    console = Console(width=width, record=True, force_terminal=True, file=io.StringIO())
    console.print(view)
    return console.export_text().splitlines()


def test_the_panel_at_80_columns(clock):
    rows = [row(4e6 * i, **EPISODES | {"episode_return": 500.0 * i}) for i in range(1, 6)]
    clock[0] = 1005.0
    lines = screen(progress_panel.Panel(status(*rows)), 80)
    assert len(lines) == 4 and max(map(len, lines)) <= 78
    assert re.fullmatch(r"━+[╸╺]?━*  50.0%  20M/40M steps  4M/s  ETA 0:05 *", lines[0])
    assert re.fullmatch(r"return +2,500 ▁▂▄▆█ +entropy +2.35 +value loss +1.23e-05", lines[1])
    assert re.fullmatch(r"success +98.4% ▁▁▁▁▁ +KL +0.0012 +explained var. +-0.988", lines[2])
    assert re.fullmatch(r"terminal error +0.000123° ▁+ +clipped +4.3% +overspeed +1.6%", lines[3])


@pytest.mark.parametrize("width", [20, 30, 40, 60, 72, 79, 80, 100, 200])
@pytest.mark.parametrize("values", [EPISODES, WORST, {}])
def test_the_panel_fits_any_width(clock, width, values):
    lines = screen(progress_panel.Panel(status(row(4e6, **values), row(8e6))), width)
    assert len(lines) == 4
    assert max(map(len, lines)) <= width - 2
    if values and width > 30:
        for i, label in enumerate(("return", "success", "terminal error"), 1):
            assert lines[i].startswith(label)
    assert (width >= 60) <= any("clipped" in text for text in lines)
    assert (width >= 72) == any("overspeed" in text for text in lines)


def test_the_panel_has_nothing_to_say_at_first(clock):
    lines = screen(progress_panel.Panel(status()), 80)
    assert "–/s  ETA –" in lines[0] and "first block" in lines[1]
    lines = screen(progress_panel.Panel(status(row(4e6))), 80)
    assert "no whole episode" in lines[1] and "has ended yet" in lines[2]
    assert "return" not in "".join(lines) and "success" not in "".join(lines)


def test_values_stay_until_there_are_new_ones(clock):
    shown = status(row(4e6, **EPISODES), row(8e6))
    assert "98.4%" in "".join(screen(progress_panel.Panel(shown), 80))
    assert "success 98.4%" in progress_status.line(shown, 1002.0)


def test_a_run_that_goes_on_shows_what_it_knew():
    rows = [{k: "" if v is None else str(v) for k, v in row(4e6, **EPISODES).items()}]
    view = progress.Progress(40_000_000, 4_000_000, rows)
    assert view._status.known["success_rate"] == 0.984
    assert view._status.steps == 4_000_000


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite(clock, bad):
    values = dict.fromkeys((*LOSSES, *EPISODES), bad)
    shown = status(row(4e6, **values), row(8e6, **EPISODES), row(12e6, **values))
    assert str(bad) in screen(progress_panel.Panel(shown), 80)[3]
    assert f"terminal error {bad}°" in progress_status.line(shown, 1003.0)


def test_lines_explain_themselves_and_fit(clock):
    text = progress_status.line(status(row(4e6)), 1001.0)
    assert text.split("  ", 4)[:4] == ["10.0%", "4M/40M steps", "4M/s", "ETA 0:09"]
    assert "no whole episode has ended yet" in text and "–" not in text and "return" not in text
    slow = status(row(12_650_000, **EPISODES), total=10**13)
    text = progress_status.line(slow, 1001.0)
    assert "return 13,807  success 98.4%  terminal error 0.000123°  entropy 2.35" in text
    assert len(text) <= 120


def test_speed_is_that_of_the_last_minute():
    shown = progress_status.Status(10**9, 5000)  # 5,000 before, which this process did not take
    shown.start(0.0)
    for seconds in range(1, 101):
        shown.add(row(5000 + 100 * seconds), float(seconds))
    assert " 100/s" in shown.describe(100.0)
    for seconds in range(101, 301):
        shown.add(row(15_000 + 1000 * (seconds - 100)), float(seconds))
    assert " 1k/s" in shown.describe(300.0)


def test_remaining_time_runs_down_between_two_blocks():
    shown = status(row(1000), total=10_000)
    assert "ETA 0:09" in shown.describe(1001.0)
    assert "ETA 0:05" in shown.describe(1005.0)
    assert "ETA 0:00" in shown.describe(1100.0)


def test_lines_are_not_many(clock, capsys):
    """Of a run of 40 hours with a block every half second: the first, the last, and some."""
    with progress.Progress(288_000, 0) as view:
        for steps in range(1, 288_001):
            clock[0] += 0.5
            view.show(row(steps))
    lines = capsys.readouterr().out.splitlines()
    assert 100 < len(lines) < 800
    assert lines[0].startswith("0.0%  1/288k steps") and lines[-1].startswith("100.0%")


def test_the_last_line_is_shown_once(clock, capsys):
    with progress.Progress(1000, 0) as view:
        view.show(row(1000))
    assert len(capsys.readouterr().out.splitlines()) == 1
    with progress.Progress(1000, 1000):
        pass
    assert capsys.readouterr().out == ""


def test_an_error_amid_it_leaves_the_last_line(clock, capsys):
    with pytest.raises(KeyError), progress.Progress(1000, 0) as view:
        view.show(row(100))
        view.show(row(200))
        raise KeyError
    assert [text.split("  ")[0] for text in capsys.readouterr().out.splitlines()] == [
        "10.0%", "20.0%"
    ]  # fmt: skip


SHOW = f"""
import sys, time
sys.path[:0] = [{str(ROOT)!r}, {str(ROOT / "tests" / "helpers")!r}]
from rows import EPISODES, row
from attjax.runs import progress
with progress.Progress(1000, 0) as view:
    for steps in range(100, 1001, 100):
        view.show(row(steps, **EPISODES))
        time.sleep(float(sys.argv[1]))
"""


def on_a_terminal(seconds, act=None, **environment):
    """What the program above writes to a terminal, and its exit status."""
    control, terminal = pty.openpty()
    environment = {"TERM": "xterm", "COLUMNS": "80", "LINES": "24"} | environment
    process = subprocess.Popen(
        [sys.executable, "-c", SHOW, str(seconds)],
        stdin=terminal, stdout=terminal, stderr=terminal, env=os.environ | environment,
    )  # fmt: skip
    os.close(terminal)
    output = b""
    while True:
        try:
            piece = os.read(control, 65536)
        except OSError:  # how Linux says that the other side is closed
            break
        if not piece:
            break
        output += piece
        if act is not None and b"return" in output:
            act(process)
            act = None
    os.close(control)
    return output.decode(), process.wait(timeout=60)


def test_a_terminal_gets_one_panel_redrawn_at_a_limited_rate():
    start = time.monotonic()
    output, status = on_a_terminal(0.2)
    redraws = output.count("terminal error")
    assert status == 0 and 3 <= redraws <= progress.REDRAWS_PER_S * (time.monotonic() - start) + 2
    last = output[output.rindex("100.0%") :]
    assert "ETA" in last and "terminal error" in last and last.endswith("\n\x1b[?25h")
    assert output.count("\n") <= 3 * (redraws + 1) + 1  # in place: no line beyond the panel's


def test_killed_at_once_it_leaves_the_cursor():
    """A second Ctrl-C ends the process without any clearing up; so the cursor is never hidden."""
    output, status = on_a_terminal(3, lambda process: process.send_signal(signal.SIGKILL))
    assert status == -signal.SIGKILL
    assert output.rfind("\x1b[?25h") > output.rfind("\x1b[?25l")


def test_a_terminal_that_can_do_nothing_gets_lines():
    output, _ = on_a_terminal(0, TERM="dumb")
    assert "\x1b" not in output and len(output.splitlines()) == 2


def test_no_colour_where_none_is_wanted():
    output, _ = on_a_terminal(0, NO_COLOR="1")
    assert "100.0%" in output and not re.search(r"\x1b\[[\d;]*3\d", output)
    output, _ = on_a_terminal(0)
    assert re.search(r"\x1b\[[\d;]*3\d", output)


@pytest.mark.parametrize("forced", [{}, {"FORCE_COLOR": "1"}])
def test_a_pipe_gets_lines(forced):
    command = [sys.executable, "-c", SHOW, "0"]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | forced)
    assert done.stderr == "" and "\x1b" not in done.stdout
    assert [text.split("  ")[0] for text in done.stdout.splitlines()] == ["10.0%", "100.0%"]


def test_a_trend_of_few_many_and_equal_values():
    assert progress_panel.trend([], 4) == "    "
    assert progress_panel.trend([3], 4) == "▁   "
    assert progress_panel.trend([2, 2, 2], 4) == "▁▁▁ "
    assert progress_panel.trend([0, 1], 4) == "▁█  "
    assert progress_panel.trend(list(range(1000)), 8) == progress_panel.LEVELS
    assert progress_panel.trend([100, 10, 1], 3) == "█▄▁"  # by the logarithm
