"""The tables of docs/robustness.md, from what ``eval.py --robustness --json`` wrote.

python eval.py --checkpoint pretrained/precise --robustness --json rows.json
python benchmarks/robustness_table.py rows.json
"""

import argparse
import json
from pathlib import Path

from attjax.evaluation.robustness_table import angle, way, without_loop

HEAD = "| | success, overspeed | rms (°) | largest (°) | believed, rms (°) | settling (s) |"
RULE = "|---|---|---|---|---|---|"


def main() -> None:
    """Print a table for each controller that the rows are of."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rows", type=Path, help="the JSON file")
    rows = json.loads(parser.parse_args().rows.read_text())
    for controller in dict.fromkeys(row["controller"] for row in rows):
        of_this = [row for row in rows if row["controller"] == controller]
        print(f"### {controller}\n\n{HEAD}\n{RULE}")
        for condition in dict.fromkeys(row["condition"] for row in of_this):
            for name, row in named([x for x in of_this if x["condition"] == condition]):
                print(line(name, row))
        print()


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
