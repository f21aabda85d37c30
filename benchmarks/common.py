"""What the simulator's benchmarks share: timing, the machine's description, tables, JSON."""

import argparse
import dataclasses
import datetime
import importlib.metadata
import json
import math
import os
import platform
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from attjax import errors
from attjax.config import command_line

PACKAGES = ("jax", "jaxlib", "numpy", "numba", "bsk")
MIN_TABLE_WIDTH = 80


@dataclasses.dataclass(frozen=True)
class Flight:
    """Something to time.

    Attributes:
        call: flies, and returns when it is done.
        agent_steps: of all spacecraft in one call.
        compile_s: time that compilation took before the first call, None if there is none.
        own_rate: if it times itself, its agent-steps/s over the seconds that it is given.
    """

    call: Callable[[], None]
    agent_steps: int
    compile_s: float | None = None
    own_rate: Callable[[float], float] | None = None


def seconds(function: Callable[[], object]) -> float:
    """Wall time of a call."""
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def measure(flights: dict[str, Flight], repeats: int, repeat_s: float) -> dict[str, list[float]]:
    """Agent-steps/s of each flight in each repeat.

    The flights take turns, so that a slow moment of the machine meets all of them alike.

    Args:
        flights: by name.
        repeats: measurements of each.
        repeat_s: shortest time of one measurement, s: short flights are flown several times.
    """
    calls, rates = {}, {name: [] for name in flights}
    for name, flight in flights.items():
        flight.call()
        calls[name] = math.ceil(repeat_s / seconds(flight.call))
    for _ in range(repeats):
        for name, flight in flights.items():
            if flight.own_rate is not None:
                rates[name].append(flight.own_rate(repeat_s))
                continue
            duration = seconds(lambda: [flight.call() for _ in range(calls[name])])  # noqa: B023
            rates[name].append(calls[name] * flight.agent_steps / duration)
    return rates


def summary(rates: list[float]) -> dict:
    """Median, lowest and highest of repeated measurements, and all of them."""
    return {
        "median": float(np.median(rates)),
        "low": min(rates),
        "high": max(rates),
        "repeats": rates,
    }


def restrict_to_cores(count: int) -> None:
    """Let this process, and the threads it starts from now on, use that many cores only.

    Raises:
        UserError: the process may use fewer.
    """
    if not hasattr(os, "sched_setaffinity"):
        raise errors.UserError(f"{platform.system()} cannot restrict a process to --cores")
    allowed = sorted(os.sched_getaffinity(0))
    if count > len(allowed):
        raise errors.UserError(f"--cores is {count}; it must be at most {len(allowed)} here")
    os.sched_setaffinity(0, allowed[:count])


def machine(device: str | None = None) -> dict:
    """Date, commit, processor, device and versions, for the head of a table and for JSON."""
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "commit": _output(
            "git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"
        ),
        "processor": processor(),
        "device": device,
        "python": platform.python_version(),
        **{name: _version(name) for name in PACKAGES},
    }


def processor() -> str:
    """Name of the processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    fields = dict(line.split(":", 1) for line in reversed(lines) if ":" in line)
    fields = {name.strip(): value.strip() for name, value in fields.items()}
    if "model name" not in fields:
        return platform.processor() or platform.machine()
    parts = [fields["model name"]]
    if "cpu family" in fields:
        parts.append(f"(family {fields['cpu family']}, model {fields['model']})")
    return " ".join(parts)


def _version(package):
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _output(*command):
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def print_machine(description: dict) -> None:
    """Print :func:`machine`'s description as two lines."""
    versions = [f"{name} {description[name]}" for name in ("python", *PACKAGES)]
    print(
        f"{description['device'] or description['processor']}, {description['date']}, "
        f"commit {description['commit']}"
    )
    print(", ".join(version for version in versions if not version.endswith("None")), "\n")


def print_table(columns: list[str], rows: list[list[str]], notes: list[str] = ()) -> None:
    """Print a table and notes under it: names to the left, on several lines if they must be."""
    console = Console(highlight=False)
    console.width = max(console.width, MIN_TABLE_WIDTH)
    table = Table(box=box.SIMPLE_HEAD, padding=0, show_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="right" if index else "left", no_wrap=index > 0)
    for row in rows:
        table.add_row(*row)
    console.print(table)
    for note in notes:
        console.print(note, style="dim")


def rate(value: float) -> str:
    """Agent-steps/s with three digits and a unit, as 9.87M.

    Example:
        >>> rate(9_870_000), rate(2_934)
        ('9.87M', '2.93k')
    """
    factor, unit = next(
        (f, u) for f, u in ((1e6, "M"), (1e3, "k"), (1, "")) if value >= f or f == 1
    )
    digits = max(0, 2 - math.floor(math.log10(max(value / factor, 1))))
    return f"{value / factor:.{digits}f}{unit}"


def write_json(path: Path | None, result: dict) -> None:
    """Write a result, if a path was given."""
    if path is not None:
        path.write_text(json.dumps(result, indent=1) + "\n")


def parser(description: str) -> command_line.Parser:
    """A parser with --json."""
    parser = command_line.Parser(description=description)
    parser.add_argument(
        "--json", type=writable_file, metavar="FILE", help="write the figures there"
    )
    return parser


def add_num_envs(parser: command_line.Parser, default: tuple[int, ...]) -> None:
    """Add --num-envs."""
    parser.add_argument(
        "--num-envs",
        type=positive_integers,
        default=list(default),
        metavar="N,N,...",
        help=f"numbers of spacecraft (default: {','.join(map(str, default))})",
    )


def writable_file(text: str) -> Path:
    """An argparse type: a file in a folder that exists."""
    path = Path(text)
    if not path.parent.is_dir() or path.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} is not a file in a folder that exists")
    return path


def positive_integers(text: str) -> list[int]:
    """An argparse type: N,N,... from 1 to 2^24, in rising order."""
    try:
        numbers = sorted({int(part) for part in text.split(",")})
    except ValueError:
        numbers = [0]
    if not 1 <= numbers[0] <= numbers[-1] <= 2**24:
        raise argparse.ArgumentTypeError(f"{text!r} must be integers from 1 to 16777216, as 1,64")
    return numbers
