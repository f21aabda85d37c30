"""What eval.py prints: the paper's Table 2 beside ours."""

from rich import box
from rich.console import Console
from rich.table import Table

from attjax.evaluation import STATISTICS

PAPER_TABLE_2 = {
    ("closest", "error_deg"): (
        0.000380, 0.000233, 0.000007, 0.000203, 0.000335, 0.000518, 0.001980),
    ("closest", "rate_rad_s"): (
        0.001976, 0.001316, 0.000066, 0.001387, 0.001868, 0.002371, 0.019339),
    ("terminal", "error_deg"): (
        0.001954, 0.000705, 0.000137, 0.001456, 0.001923, 0.002433, 0.004558),
    ("terminal", "rate_rad_s"): (
        0.001752, 0.001088, 0.000106, 0.001215, 0.001649, 0.002155, 0.018723),
}  # fmt: skip
"""Table 2 of the paper, in the order of STATISTICS; angles in degrees, rates in rad/s."""

TABLE_WIDTH = 100
ROW_NAMES = ("Mean", "Std. dev.", "Min", "Q1", "Q2", "Q3", "Max")
SYMBOLS = {"error_deg": "φ (°)", "rate_rad_s": "‖ω‖ (rad/s)"}


def print_report(result: dict) -> None:
    """Print what ``evaluation.evaluate`` returns, with the controller's name."""
    console = _console()
    console.print(f"{result['controller']}: {_conditions(result)}\n")
    console.print(_table_2(result))
    console.print()
    for name, value in _summary(result):
        console.print(f"{name:<18}{value}")


def print_comparison(results: list[dict]) -> None:
    """Print several controllers' results over the same slews, and the paper's, side by side."""
    console = _console()
    console.print(f"{_conditions(results[0])}\n")
    table = _table("")
    for result in results:
        table.add_column(result["controller"], justify="right", no_wrap=True)
    table.add_column("paper", justify="right", no_wrap=True, style="dim")
    for name, cell in COMPARED.items():
        table.add_row(name, *map(cell, results), PAPER_COMPARED.get(name, ""))
    console.print(table)


def _console():
    console = Console(highlight=False)
    console.width = max(console.width, TABLE_WIDTH)
    return console


def _table(first_column):
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column(first_column, no_wrap=True)
    return table


def _conditions(result):
    return (
        f"{result['episodes']:,} slews at {result['control_hz']:.2f} Hz "
        f"(frameskip {result['frameskip']}) of {result['duration_s']:.2f} s, "
        f"seed {result['seed']}"
    )


def _table_2(result):
    table = _table("\n")
    for state, quantity in PAPER_TABLE_2:
        title = f"{state.capitalize()}\n{SYMBOLS[quantity]}"
        table.add_column(title, justify="right", no_wrap=True)
        table.add_column("\npaper", justify="right", no_wrap=True, style="dim")
    for index, (statistic, name) in enumerate(zip(STATISTICS, ROW_NAMES)):
        cells = []
        for (state, quantity), paper in PAPER_TABLE_2.items():
            cells += [_fixed(result[state][quantity][statistic]), f"{paper[index]:.6f}"]
        table.add_row(name, *cells)
    return table


def _summary(result):
    settling, returns = result["settling_time_s"], result["episode_return"]
    success = result["terminal_success"]["error_deg"]
    count = round(result["success_rate"] * result["episodes"])
    impulse = result["impulse_N_m_s"]
    yield "success", f"{result['success_rate']:.2%} ({count:,} of {result['episodes']:,})"
    yield "overspeed", f"{result['overspeed_rate']:.2%}"
    if count:
        yield (
            "error at the end",
            (f"{success['mean']:.3g}° mean, {success['max']:.3g}° max (successes)"),
        )
        yield (
            "settling time",
            (
                f"{settling['mean']:.2f} s mean, {settling['q2']:.2f} s median, "
                f"{settling['max']:.2f} s max; never: {settling['never']:,}"
            ),
        )
    yield "return", f"{returns['mean']:.1f} mean (Eq. 12-13)"
    yield "impulse", f"{impulse['mean']:.3f} N m s mean"


def _fixed(value):
    """Six decimals like the paper's table; two digits where those would show nothing."""
    return f"{value:.6f}" if value >= 9.5e-6 else f"{value:.1e}"


def _statistic(group, quantity, statistic):
    def cell(result):
        value = (result[group][quantity] if quantity else result[group])[statistic]
        if value is None:
            return "–"
        return _fixed(value) if quantity else f"{value:.2f}"

    return cell


COMPARED = {
    "success (%)": lambda result: f"{100 * result['success_rate']:.2f}",
    "overspeed (%)": lambda result: f"{100 * result['overspeed_rate']:.2f}",
    "terminal φ, mean (°)": _statistic("terminal", "error_deg", "mean"),
    "terminal φ, max (°)": _statistic("terminal", "error_deg", "max"),
    "terminal ‖ω‖, mean (rad/s)": _statistic("terminal", "rate_rad_s", "mean"),
    "closest φ, mean (°)": _statistic("closest", "error_deg", "mean"),
    "closest φ, max (°)": _statistic("closest", "error_deg", "max"),
    "settling time, mean (s)": _statistic("settling_time_s", None, "mean"),
    "settling time, max (s)": _statistic("settling_time_s", None, "max"),
    "return, mean (Eq. 12-13)": _statistic("episode_return", None, "mean"),
    "impulse, mean (N m s)": _statistic("impulse_N_m_s", None, "mean"),
}
"""Rows of the comparison: a name, and the function that gives a result's cell."""

PAPER_COMPARED = {
    "success (%)": "100.00",
    "terminal φ, mean (°)": "0.001954",
    "terminal φ, max (°)": "0.004558",
    "terminal ‖ω‖, mean (rad/s)": "0.001752",
    "closest φ, mean (°)": "0.000380",
    "closest φ, max (°)": "0.001980",
}
"""What the paper gives of these, all at 40 Hz."""
