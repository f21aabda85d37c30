"""What ``eval.py --robustness`` prints."""

import itertools
from collections.abc import Sequence

from attjax.evaluation.robustness import Flights, wilson
from attjax.evaluation.tables import console

HEADS = ("", "success (%)", "overspeed (%)", "rms (°)", "max (°)", "believed", "settl.", "N m s")
WIDTHS = (23, 19, 18, 9, 9, 9, 7, 6)
NOTE = """\
Success and overspeed with 95 % intervals (Wilson). rms and max: error angle over the last fifth of
the slews that kept the rate limit. believed: rms, in degrees, of what was taken for the attitude,
against the truth. settl.: settling time, s, mean of the successes. N m s: impulse, mean. A name
alone is of the flight loop and of the bare controller both, where they do the same."""


def print_table(rows: Sequence[dict], flights: Flights) -> None:
    """Print the rows of :func:`attjax.evaluation.robustness.robustness`."""
    env, out = flights.env, console()
    out.print(
        f"{flights.episodes:,} slews a row at {1 / env.control_period:.2f} Hz "
        f"(frameskip {env.frameskip}), {env.spacecraft.name}, seed {flights.seed}"
    )
    if flights.assured:
        out.print("flight loops under run-time assurance")
    out.print()
    out.print(_line(HEADS), style="dim")
    for condition, group in itertools.groupby(rows, lambda row: row["condition"]):
        out.print(condition, style="bold")
        for name, row in named(list(group)):
            out.print(_line((f"  {name}", *cells(row))))
    out.print(f"\n{NOTE}", style="dim")


def named(rows: Sequence[dict]) -> list[tuple[str, dict]]:
    """Names and rows of a condition; where a flight loop changes nothing, one row for both.

    Example:
        >>> looped = {"controller": "feedback", "flight_loop": True, "rms_deg": 0.1}
        >>> bare = looped | {"flight_loop": False}
        >>> [name for name, row in named([looped, bare])]
        ['feedback']
        >>> [name for name, row in named([looped, bare | {"rms_deg": 0.2}])]
        ['feedback, loop', 'feedback, bare']
    """
    found = []
    for row in rows:
        has_twin = sum(without_loop(row) == without_loop(other) for other in rows) > 1
        if not has_twin:
            found.append((f"{row['controller']}, {way(row)}", row))
        elif row["flight_loop"]:
            found.append((row["controller"], row))
    return found


def way(row: dict) -> str:
    """How it was flown: bare, in a flight loop, or in one that adapts."""
    if row.get("adaptive"):
        return "adaptive"
    return "loop" if row["flight_loop"] else "bare"


def without_loop(row: dict) -> dict:
    """The row, but for whether it is in a flight loop."""
    return {name: x for name, x in row.items() if name not in ("flight_loop", "assured")}


def _line(words):
    first, *others = words
    aligned = [word.rjust(width) for word, width in zip(others, WIDTHS[1:])]
    return first.ljust(WIDTHS[0]) + "".join(aligned)


def cells(row: dict) -> list[str]:
    """A row's figures in the order of the columns.

    Example:
        >>> cells({"success_rate": 1.0, "overspeed_rate": 0.0, "episodes": 1000, "rms_deg": 8e-5,
        ...        "max_deg": 3e-4, "estimate_rms_deg": 0.0, "settling_time_s": None,
        ...        "impulse_N_m_s": 0.68})
        ['100.0 (99.6-100.0)', '0.0 (0.0-0.4)', '0.000080', '0.00030', '0', '–', '0.68']
    """
    rates = [_rate(row[x], row["episodes"]) for x in ("success_rate", "overspeed_rate")]
    angles = [angle(row[x]) for x in ("rms_deg", "max_deg", "estimate_rms_deg")]
    settling, impulse = row["settling_time_s"], row["impulse_N_m_s"]
    return [*rates, *angles, "–" if settling is None else f"{settling:.2f}", f"{impulse:.2g}"]


def _rate(share, count):
    low, high = wilson(share, count)
    return f"{100 * share:.1f} ({100 * low:.1f}-{100 * high:.1f})"


def angle(degrees: float | None) -> str:
    """To two digits, however small; below what single precision knows, as 0.

    Example:
        >>> angle(0.00215), angle(12.3), angle(3e-9), angle(None)
        ('0.0022', '12', '0', '–')
    """
    if degrees is None:
        return "–"
    if degrees < 1e-6:
        return "0"
    digits = 2
    while degrees * 10 ** (digits - 1) < 1:
        digits += 1
    if degrees >= 10:
        return f"{degrees:.0f}"
    return f"{degrees:.{digits}f}" if degrees < 1 else f"{degrees:.1f}"
