"""The tables of docs/robustness.md, from what ``eval.py --robustness --json`` wrote.

python eval.py --checkpoint pretrained/precise --robustness --json rows.json
python benchmarks/robustness_table.py rows.json
python benchmarks/robustness_table.py --side-by-side rows.json
"""

import argparse
import json
from pathlib import Path

from attjax.evaluation.robustness_table import angle, way, without_loop

HEAD = "| | success, overspeed | rms (°) | largest (°) | believed, rms (°) | settling (s) |"
RULE = "|---|---|---|---|---|---|"


def main() -> None:
    """Print a table for each controller that the rows are of, or one for all of them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", type=Path, help="the JSON file")
    parser.add_argument("--side-by-side", action="store_true", help="flight loops, in one table")
    given = parser.parse_args()
    rows = json.loads(given.rows.read_text())
    if given.side_by_side:
        print("\n".join(side_by_side(rows)))
        return
    for controller in dict.fromkeys(row["controller"] for row in rows):
        of_this = [row for row in rows if row["controller"] == controller]
        print(f"### {controller}\n\n{HEAD}\n{RULE}")
        for condition in dict.fromkeys(row["condition"] for row in of_this):
            for name, row in named([x for x in of_this if x["condition"] == condition]):
                print(line(name, row))
        print()


def side_by_side(rows: list[dict]) -> list[str]:
    """Lines of a table with a row for each condition and a column for each flight loop."""
    looped = [row for row in rows if row["flight_loop"]]
    columns = dict.fromkeys((row["controller"], way(row)) for row in looped)
    lines = [["", *(f"{controller}, {loop}" for controller, loop in columns)]]
    lines.append(["---"] * len(lines[0]))
    for condition in dict.fromkeys(row["condition"] for row in looped):
        cells = {(x["controller"], way(x)): cell(x) for x in looped if x["condition"] == condition}
        lines.append([condition, *(cells.get(column, "") for column in columns)])
    return [f"| {' | '.join(line)} |" for line in lines]


def cell(row: dict) -> str:
    """Success, overspeed where there is any, rms error and settling time."""
    words = f"{100 * row['success_rate']:.1f} %"
    if row["overspeed_rate"]:
        words += f" ({100 * row['overspeed_rate']:.1f} % over)"
    settling = row["settling_time_s"]
    words += "" if row["rms_deg"] is None else f", {angle(row['rms_deg'])}°"
    return words + ("" if settling is None else f", {settling:.2f} s")


def named(rows: list[dict]) -> list[tuple[str, dict]]:
    """A condition's rows of one controller: in a flight loop, and others that differ from it."""
    looped = next(row for row in rows if way(row) == "loop")
    found = [(looped["condition"], looped)]
    for row in rows:
        if row is not looped and figures(row) != figures(looped):
            found.append((f"— {way(row)}", row))
    return found


def figures(row: dict) -> dict:
    """What came of it, however it was flown."""
    return {name: x for name, x in without_loop(row).items() if name != "adaptive"}


def line(name: str, row: dict) -> str:
    """A row of the table."""
    rates = " %, ".join(f"{100 * row[x]:.1f}" for x in ("success_rate", "overspeed_rate")) + " %"
    angles = [angle(row[x]) for x in ("rms_deg", "max_deg", "estimate_rms_deg")]
    settling = row["settling_time_s"]
    cells = [name, rates, *angles, "–" if settling is None else f"{settling:.2f}"]
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
