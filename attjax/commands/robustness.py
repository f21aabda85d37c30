"""``eval.py --robustness``: controllers in worlds that are not perfect."""

import argparse
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from attjax.commands import evaluation_output

if TYPE_CHECKING:
    from attjax.envs.attitude import AttitudeEnv


def judge(
    arguments: argparse.Namespace,
    controllers: Mapping[str, Any],
    env: "AttitudeEnv",
    json_file: Path | TextIO | None,
) -> int:
    """Fly, write and print; returns the exit status.

    Args:
        arguments: of the command line.
        controllers: plain ones by name.
        env: that they fly in the ideal world.
        json_file: where the rows are written, too.
    """
    # Imported late: with them, --help and errors in the arguments would take seconds.
    from attjax.evaluation import robustness, robustness_table

    how = {"adaptive": arguments.adaptive, "assured": arguments.assured}
    flights = robustness.Flights(env, arguments.episodes, arguments.seed or 0, **how)
    start, written = time.monotonic(), []
    with evaluation_output.flying("conditions", None) as told:
        rows = robustness.robustness(controllers, flights, told)
    seconds = time.monotonic() - start
    try:
        if json_file:
            evaluation_output.write_json(json_file, rows)
        if arguments.plot:
            from attjax.evaluation import robustness_plots

            written += robustness_plots.write_all(rows, arguments.plot)
    finally:  # where one of them fails, too
        robustness_table.print_table(rows, flights)
        for path in written:
            print(f"wrote {path}")
        print(f"flown in {seconds:.1f} s, compilation included")
    return 0
