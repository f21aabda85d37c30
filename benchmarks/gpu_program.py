"""What attjax's programs are on a GPU, compiled for it without one: kernels, bytes, a bound.

XLA compiles for a card from its data sheet. What is printed is read from the compiled programs:
how many kernels they launch, what those must read, write and compute, and, of the physics, the
registers and what is spilled from them. The bound is computed and not run: each kernel takes its
launch, its bytes at the memory's bandwidth or its operations at the lanes' peak, whichever is the
longest, one kernel after another. Only cheaper launches, or a cache that holds what is counted as
memory, could beat it.

    pip install 'attjax[gpu-compile]'

Example:
    python benchmarks/gpu_program.py --target rtx-2070-super --preset precise
"""

import importlib
import importlib.util
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import common
import gpu_kernels
from gpu_cards import CARDS, Card

from attjax import errors
from attjax.config import command_line
from attjax.config.presets import PRESETS

LAUNCH_US = 4.0
OPTIONS = {"xla_gpu_autotune_level": 0, "xla_gpu_enable_triton_gemm": False}
"""Neither measures kernels, which takes a card, nor compiles those that the oldest have not."""

COLUMNS = ["", "compile\n(s)", "kernels", "launches\na unit", "memory\n(MiB)"]
COLUMNS += ["without\nlaunches\n(us a unit)", "bound\n(us a unit)"]


class Program(NamedTuple):
    """A compiled program.

    Attributes:
        unit, units: what it does, and how many of it.
        compile_s: time of the compilation.
        kernels: what it launches.
        memory: bytes of arguments, results and temporaries.
        resources: {kernel: (registers, bytes of spills)} where ptxas was there to tell.
    """

    unit: str
    units: int
    compile_s: float
    kernels: list[gpu_kernels.Kernel]
    memory: int
    resources: dict[str, tuple[int, int]]


def parse_arguments(argv=None):
    """The command line."""
    parser = common.parser(__doc__)
    parser.add_argument(
        "--target", choices=CARDS, default="rtx-2070-super", help="(default: %(default)s)"
    )
    parser.add_argument(
        "--preset", choices=PRESETS, default="precise", help="(default: %(default)s)"
    )
    command_line.add_number(parser, "launch-us", float, LAUNCH_US, "time of a launch, us", low=0)
    command_line.add_number(parser, "slews", int, 2048, "of the evaluation", low=1)
    command_line.add_number(
        parser, "longest", int, 0, "show so many kernels of each program", low=0
    )
    return parser.parse_args(argv)


@errors.program("gpu_program.py")
def main(argv=None) -> int:
    """Compile, count and print; returns the exit status."""
    arguments = parse_arguments(argv)
    os.environ["JAX_PLATFORMS"] = "cpu"
    with errors.one_line_errors():
        device = without_a_card(CARDS[arguments.target])
    lowered = importlib.import_module("gpu_lowered")
    sharding = importlib.import_module("attjax.sharding")
    card, programs = CARDS[arguments.target], []
    machine = common.machine(f"{card.name}, compiled for and not run")
    common.print_machine(machine)
    with sharding.compiled_for([device]):
        for unit, units, lower in lowered.programs(arguments.preset, arguments.slews):
            programs.append(compiled(card, unit, units, lower()))
            print(unit, "compiled", file=sys.stderr)
    figures = [figures_of(x, card, arguments.launch_us) for x in programs]
    common.print_table(COLUMNS, list(map(row, figures)), notes(card, arguments.launch_us, figures))
    for program in programs:
        print_longest(program, card, arguments)
    common.write_json(arguments.json, {"machine": machine, "programs": figures})
    return 0


def without_a_card(card: Card):
    """A device of JAX to compile for.

    Raises:
        UserError: what compiles for it is not installed.
    """
    if not _has_plugin() or _ptxas() is None:
        raise errors.UserError("no compiler for CUDA; pip install 'attjax[gpu-compile]'")
    from jax.experimental import topologies

    topology = topologies.get_topology_desc(
        platform="cuda", target_config=card.target, topology="1x1x1"
    )
    return topology.devices[0]


def _has_plugin() -> bool:
    """Whether there is one for CUDA 12, and not only another."""
    found = importlib.util.find_spec("jax_plugins")
    return found is not None and importlib.util.find_spec("jax_plugins.xla_cuda12") is not None


def _ptxas() -> Path | None:
    found = importlib.util.find_spec("nvidia")
    places = [] if found is None else found.submodule_search_locations
    paths = [path for place in places for path in Path(place).glob("*/bin/ptxas")]
    return paths[0] if paths else None


def compiled(card: Card, unit: str, units: int, lowered) -> Program:
    """Compile a lowered program, and read it."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        program = lowered.compile({**OPTIONS, "xla_dump_to": folder})
        compile_s = time.perf_counter() - start
        resources = registers(card, Path(folder))
    sizes = program.memory_analysis()
    memory = sizes.argument_size_in_bytes + sizes.output_size_in_bytes + sizes.temp_size_in_bytes
    memory -= sizes.alias_size_in_bytes
    kernels = gpu_kernels.kernels(program.as_text())
    return Program(unit, units, compile_s, kernels, memory, resources)


def registers(card: Card, folder: Path) -> dict[str, tuple[int, int]]:
    """Registers a thread and bytes spilled, of each kernel that XLA left there as PTX."""
    found = {}
    for path in folder.glob("*.ptx"):
        command = [_ptxas(), "-v", f"-arch={card.architecture}", path, "-o", os.devnull]
        told = subprocess.run(command, capture_output=True, text=True, check=True).stderr
        for part in told.split("Compiling entry function '")[1:]:
            spilled = sum(map(int, re.findall(r"(\d+) bytes spill", part)))
            found[part.split("'")[0]] = int(re.search(r"Used (\d+) registers", part)[1]), spilled
    return found


def bound_us(kernel: gpu_kernels.Kernel, card: Card, launch_us: float) -> float:
    """Shortest time of all launches of a kernel, us."""
    moved, computed = kernel.bytes / card.bandwidth, kernel.operations / card.flops
    return kernel.times * max(launch_us, 1e6 * moved, 1e6 * computed)


def figures_of(program: Program, card: Card, launch_us: float) -> dict:
    """What the table tells of a program, and more of its kernels."""
    kernels, units = program.kernels, program.units
    heaviest = max(kernels, key=lambda x: x.times * x.operations)
    return {
        "unit": program.unit,
        "units": units,
        "compile_s": program.compile_s,
        "kernels": len(kernels),
        "launches": sum(x.times for x in kernels) / units,
        "memory_bytes": program.memory,
        "free_us": sum(bound_us(x, card, 0.0) for x in kernels) / units,
        "bound_us": sum(bound_us(x, card, launch_us) for x in kernels) / units,
        "heaviest": heaviest.name,
        "registers_and_spills": program.resources.get(heaviest.name.replace(".", "_")),
    }


def row(figures: dict) -> list[str]:
    """A program's row of the table."""
    return [
        figures["unit"],
        f"{figures['compile_s']:.1f}",
        str(figures["kernels"]),
        f"{figures['launches']:.4g}",
        f"{figures['memory_bytes'] / 2**20:.1f}",
        f"{figures['free_us']:.4g}",
        f"{figures['bound_us']:.4g}",
    ]


def notes(card: Card, launch_us: float, figures_of_all: list[dict]) -> list[str]:
    """What stands below the table."""
    lines = [f"Computed, not run: {launch_us:g} us a launch, {card.bandwidth / 1e9:.0f} GB/s, "]
    lines[0] += f"{card.flops / 1e12:.1f} Tflop/s."
    for figures in figures_of_all:
        told = figures["registers_and_spills"]
        if told:
            lines.append(
                f"{figures['unit']}: {figures['heaviest']}, the kernel with the most operations, "
                f"has {told[0]} registers and spills {told[1]} bytes."
            )
    return lines


def print_longest(program: Program, card: Card, arguments) -> None:
    """The kernels that take the longest by the bound, if they were asked for."""

    def bound(kernel):
        return bound_us(kernel, card, arguments.launch_us)

    longest = sorted(program.kernels, key=bound, reverse=True)[: arguments.longest]
    rows = [
        [x.name, str(x.times), str(x.bytes), str(x.operations), f"{bound(x) / program.units:.4g}"]
        for x in longest
    ]
    if rows:
        columns = [program.unit, "launches", "bytes", "operations", "bound\n(us a unit)"]
        common.print_table(columns, rows)


if __name__ == "__main__":
    sys.exit(main())
