"""What eval.py prints: the paper's Table 2 beside ours."""

from rich import box
from rich.console import Console
from rich.table import Table

from attjax.evaluation.paper import PAPER_TABLE_2, is_the_papers
from attjax.evaluation.summary import STATISTICS
from attjax.spacecraft import Spacecraft
from attjax.world import IDEAL

POINTING_ROWS = {
    "terminal φ, mean (°)": ("terminal", "error_deg", "mean"),
    "terminal φ, max (°)": ("terminal", "error_deg", "max"),
    "terminal ‖ω‖, mean (rad/s)": ("terminal", "rate_rad_s", "mean"),
    "closest φ, mean (°)": ("closest", "error_deg", "mean"),
    "closest φ, max (°)": ("closest", "error_deg", "max"),
}
OTHER_ROWS = {
    "settling time, mean (s)": ("settling_time_s", "mean"),
    "settling time, max (s)": ("settling_time_s", "max"),
    "return, mean (Eq. 12-13)": ("episode_return", "mean"),
    "impulse, mean (N m s)": ("impulse_N_m_s", "mean"),
}
"""Rows of the comparison; the paper has figures for the pointing only."""

RATIOS = {
    "settling over estimate": "settling_over_estimate",
    "error over quantisation": "terminal_over_quantisation",
}
"""More of them, of a fleet."""

TABLE_WIDTH = 100
ROW_NAMES = ("Mean", "Std. dev.", "Min", "Q1", "Q2", "Q3", "Max")
SYMBOLS = {"error_deg": "φ (°)", "rate_rad_s": "‖ω‖ (rad/s)"}


def print_report(result: dict, spacecraft: Spacecraft) -> None:
    """Print one controller's name, conditions and statistics, as in ``eval.py --json``.

    The paper's statistics stand beside those of its spacecraft, LM50, in its world.
    """
    out = console()
    out.print(f"{result['controller']}: {_conditions(result, spacecraft)}\n")
    out.print(_table_2(result, is_the_papers(spacecraft, _world(result))))
    out.print()
    for name, value in _summary(result):
        out.print(f"{name:<18}{value}")


def print_comparison(results: list[dict], spacecraft: Spacecraft) -> None:
    """Print several controllers' results over the same slews, side by side.

    The paper's results stand beside those of its spacecraft, LM50, in its world.
    """
    out = console()
    out.print(f"{_conditions(results[0], spacecraft)}\n")
    table = plain_table("")
    for result in results:
        table.add_column(result["controller"], justify="right", no_wrap=True)
    with_paper = is_the_papers(spacecraft, _world(results[0]))
    if with_paper:
        table.add_column("paper", justify="right", no_wrap=True, style="dim")
    success = [f"{100 * r['success_rate']:.2f}" for r in results]
    table.add_row("success (%)", *success, *["100.00"] * with_paper)
    table.add_row("overspeed (%)", *(f"{100 * r['overspeed_rate']:.2f}" for r in results))
    for name, (state, quantity, statistic) in POINTING_ROWS.items():
        ours = [_fixed(r[state][quantity][statistic]) for r in results]
        paper = PAPER_TABLE_2[state, quantity][STATISTICS.index(statistic)]
        table.add_row(name, *ours, *[_fixed(paper)] * with_paper)
    for name, (quantity, statistic) in OTHER_ROWS.items():
        values = [r[quantity][statistic] for r in results]
        form = ".3g" if quantity == "impulse_N_m_s" else ".2f"
        table.add_row(name, *("–" if x is None else format(x, form) for x in values))
    for name, ratio in RATIOS.items():
        if ratio in results[0]:
            values = [r[ratio] for r in results]
            table.add_row(name, *("–" if x is None else f"{x:.3f}" for x in values))
    out.print(table)


def console() -> Console:
    """Where tables are printed: at least so wide that each of their rows is a line."""
    wide = Console(highlight=False, markup=False)
    wide.width = max(wide.width, TABLE_WIDTH)
    return wide


def plain_table(first_column: str) -> Table:
    """A table without borders, with its first column."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column(first_column, no_wrap=True)
    return table


def _world(result):
    return result.get("world", IDEAL.name)


def _conditions(result, spacecraft):
    craft = "" if is_the_papers(spacecraft) else f"{spacecraft.name}, "
    world = "" if _world(result) == IDEAL.name else f"world {_world(result)}, "
    return (
        f"{result['episodes']:,} slews at {result['control_hz']:.2f} Hz "
        f"(frameskip {result['frameskip']}) of {result['duration_s']:.2f} s, "
        f"{craft}{world}seed {result['seed']}"
    )


def _table_2(result, with_paper):
    table = plain_table("\n")
    for state, quantity in PAPER_TABLE_2:
        title = f"{state.capitalize()}\n{SYMBOLS[quantity]}"
        table.add_column(title, justify="right", no_wrap=True)
        if with_paper:
            table.add_column("\npaper", justify="right", no_wrap=True, style="dim")
    for index, (statistic, name) in enumerate(zip(STATISTICS, ROW_NAMES)):
        cells = []
        for (state, quantity), paper in PAPER_TABLE_2.items():
            cells.append(_fixed(result[state][quantity][statistic]))
            if with_paper:
                cells.append(f"{paper[index]:.6f}")
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
    if result.get("settling_over_estimate"):
        yield (
            "beside estimates",
            (
                f"settling {result['settling_over_estimate']:.3f} of the estimate, "
                f"error {result['terminal_over_quantisation']:.2f} of the quantisation"
            ),
        )
    yield "return", f"{returns['mean']:.1f} mean (Eq. 12-13)"
    yield "impulse", f"{impulse['mean']:.3g} N m s mean"


def _fixed(value):
    """Six decimals like the paper's table; two digits where those would show nothing."""
    return f"{value:.6f}" if value >= 9.5e-6 else f"{value:.1e}"
