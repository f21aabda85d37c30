"""The tables of docs/robustness.md, from what ``eval.py --robustness --json`` wrote.

python eval.py --checkpoint pretrained/precise --robustness --json rows.json
python benchmarks/robustness_table.py rows.json
"""

import argparse
import json
from pathlib import Path

from attjax.evaluation.robustness_table import angle, without_loop

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
        for looped, bare in paired(of_this):
            print(line(looped["condition"], looped))
            if without_loop(looped) != without_loop(bare):
                print(line("— bare", bare))
        print()


def paired(rows: list[dict]) -> list[tuple[dict, dict]]:
    """The row in a flight loop and the bare one of each condition."""
    bare = {row["condition"]: row for row in rows if not row["flight_loop"]}
    return [(row, bare[row["condition"]]) for row in rows if row["flight_loop"]]


def line(name: str, row: dict) -> str:
    """A row of the table."""
    rates = " %, ".join(f"{100 * row[x]:.1f}" for x in ("success_rate", "overspeed_rate")) + " %"
    angles = [angle(row[x]) for x in ("rms_deg", "max_deg", "estimate_rms_deg")]
    settling = row["settling_time_s"]
    cells = [name, rates, *angles, "–" if settling is None else f"{settling:.2f}"]
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
