"""What ``eval.py --robustness`` prints."""

from collections.abc import Sequence

from attjax.evaluation.robustness import Flights, wilson
from attjax.evaluation.tables import console, plain_table

COLUMNS = (
    "success (%)", "overspeed (%)", "rms (°)", "max (°)", "believed (°)", "settling (s)",
    "impulse",
)  # fmt: skip
NOTE = """\
success and overspeed with 95 % intervals (Wilson); rms and max: error angle over the last fifth of
the slews that kept the rate limit; believed: rms of what was taken for the attitude against the
truth; settling: of the successes, mean; impulse: N m s, mean. "bare" is without flight loop."""


def print_table(rows: Sequence[dict], flights: Flights) -> None:
    """Print the rows of :func:`attjax.evaluation.robustness.robustness`."""
    env, out = flights.env, console()
    out.print(
        f"{flights.episodes:,} slews a row at {1 / env.control_period:.2f} Hz "
        f"(frameskip {env.frameskip}), {env.spacecraft.name}, seed {flights.seed}\n"
    )
    out.print(_table(rows))
    out.print(NOTE, style="dim")


def _table(rows):
    table = plain_table("")
    for name in COLUMNS:
        table.add_column(name, justify="right", no_wrap=True)
    condition = None
    for row in rows:
        if row["condition"] != condition:
            condition = row["condition"]
            table.add_row(condition, style="bold")
        name = row["controller"] + ("" if row["flight_loop"] else ", bare")
        table.add_row(f"  {name}", *cells(row))
    return table


def cells(row: dict) -> list[str]:
    """A row's figures in the order of the columns.

    Example:
        >>> cells({"success_rate": 1.0, "overspeed_rate": 0.0, "episodes": 1000, "rms_deg": 8e-5,
        ...        "max_deg": 3e-4, "estimate_rms_deg": 0.0, "settling_time_s": None,
        ...        "impulse_N_m_s": 0.68})[:3]
        ['100.0 [99.6, 100.0]', '0.0 [0.0, 0.4]', '0.00008']
    """
    rates = [_rate(row[x], row["episodes"]) for x in ("success_rate", "overspeed_rate")]
    angles = [_angle(row[x]) for x in ("rms_deg", "max_deg", "estimate_rms_deg")]
    settling, impulse = row["settling_time_s"], row["impulse_N_m_s"]
    return [*rates, *angles, "–" if settling is None else f"{settling:.2f}", f"{impulse:.3g}"]


def _rate(share, count):
    low, high = wilson(share, count)
    return f"{100 * share:.1f} [{100 * low:.1f}, {100 * high:.1f}]"


def _angle(angle):
    """To two digits, however small."""
    if angle is None:
        return "–"
    return f"{angle:.5f}" if 0 < angle < 0.001 else f"{angle:.3g}"
