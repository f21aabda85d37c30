"""Throughput of the simulator beside its peers, against the number of spacecraft.

Everything runs on one core of one process unless --cores says otherwise, and the contenders'
measurements take turns. The ceiling is C, vectorised by hand and checked against attjax.

Example:
    python benchmarks/simulator.py --json simulator.json --plot simulator.png
    python benchmarks/simulator.py --num-envs 1,2048 --repeats 3
"""

import importlib
import sys

import common
import numpy as np

from attjax import errors
from attjax.config import command_line

NUM_ENVS = (1, 4, 16, 64, 256, 1024, 2048, 4096, 16384, 65536, 262144, 1048576)
RK4_STEPS = 21
REPEAT_S = 0.3
REFERENCE = 256
CEILING = 25e6
"""Agent-steps/s of a full step that the C code must reach on a core to count as ceiling."""

COLUMNS = (
    "",
    "space-\ncraft",
    "compile\n(s)",
    "agent-\nsteps/s",
    "\nrange",
    "physics-\nsteps/s",
    "\nof C",
)


def parse_arguments(argv):
    """The command line."""
    parser = common.parser(__doc__)
    plot_help = "draw throughput against the number of spacecraft"
    parser.add_argument("--plot", type=common.writable_file, metavar="FILE.png", help=plot_help)
    common.add_num_envs(parser, NUM_ENVS)
    command_line.add_number(parser, "repeats", int, 7, "measurements of each figure", low=1)
    command_line.add_number(
        parser, "cores", int, 1, "processor cores; the fused rollout uses all", low=1
    )
    parser.add_argument("--device", choices=("cpu", "gpu"), default="cpu", help="(default: cpu)")
    return parser.parse_args(argv)


@errors.program("simulator.py")
def main(argv=None) -> int:
    """Run the benchmark; returns the exit status."""
    arguments = parse_arguments(argv)
    with errors.one_line_errors():
        check_sizes(arguments)
        device = select_device(arguments.device, arguments.cores)
    machine = common.machine(device.device_kind if arguments.device == "gpu" else None)
    common.print_machine(machine)
    # Imported late: it imports JAX's arrays, and cores and device must be set before.
    peers = importlib.import_module("peers")
    with errors.one_line_errors(ArithmeticError):
        contenders, absent = peers.find(arguments.device, arguments.cores)
    rows, ceilings = measure(peers, contenders, arguments.num_envs, arguments.repeats)
    result = {"machine": machine, "cores": arguments.cores, "ceilings": ceilings}
    result |= {"absent": absent, "rows": rows}
    print_result(result)
    common.write_json(arguments.json, result)
    if arguments.plot is not None:
        importlib.import_module("throughput_figure").draw(result, arguments.plot)
    return 0


def check_sizes(arguments) -> None:
    """Refuse numbers of spacecraft that the cores cannot share out evenly."""
    cores = arguments.cores
    uneven = [n for n in arguments.num_envs if n > cores and n % cores]
    if uneven:
        raise errors.UserError(f"--num-envs has {uneven[0]}, not a multiple of --cores, {cores}")


def select_device(name: str, cores: int):
    """JAX's device; on CPU, JAX gets as many devices as cores, and no other core is used."""
    if name == "cpu":
        common.restrict_to_cores(cores)
    import jax

    jax.config.update("jax_num_cpu_devices", cores)
    try:
        device = jax.devices(name)[0]
    except RuntimeError:
        raise errors.UserError(f"--device is {name}, and JAX finds none") from None
    jax.config.update("jax_default_device", device)
    return device


def measure(peers, contenders, sizes: list[int], repeats: int) -> tuple[list[dict], dict]:
    """Rows, one a contender and number of spacecraft, and the best medians of the C code.

    The C code takes its turn with every number of spacecraft, always with REFERENCE of its own,
    so that fractions of it are fractions at the same moment.
    """
    rows, ceilings = [], {}
    references = {c.name: c.build(REFERENCE) for c in contenders if c.name in peers.CEILINGS}
    for num_envs in sizes:
        taking_part = [c for c in contenders if num_envs == 1 or not c.one]
        flights = {(c.name, num_envs): c.build(num_envs) for c in taking_part}
        flights |= {(name, "reference"): flight for name, flight in references.items()}
        rates = common.measure(flights, repeats, REPEAT_S)
        for (name, _), measured in rates.items():
            if name in references:
                ceilings[name] = max(ceilings.get(name, 0), float(np.median(measured)))
        for contender in taking_part:
            compile_s = flights[contender.name, num_envs].compile_s
            own = rates[contender.name, num_envs]
            ceiling = rates.get((peers.CEILINGS[not contender.full], "reference"))
            rows.append(_row(contender, num_envs, compile_s, own, ceiling))
        print(f"{num_envs:,} done", file=sys.stderr, flush=True)
    return rows, ceilings


def _row(contender, num_envs, compile_s, rates, ceiling):
    fraction = None if ceiling is None else float(np.median(np.divide(rates, ceiling)))
    row = {"name": contender.name, "full": contender.full, "num_envs": num_envs}
    return {**row, "compile_s": compile_s, **common.summary(rates), "fraction": fraction}


def print_result(result: dict) -> None:
    """Print the table, contender by contender, and how it is to be read."""
    names = dict.fromkeys(row["name"] for row in result["rows"])
    cells = [_cells(row) for name in names for row in result["rows"] if row["name"] == name]
    cells += [[name, *["–"] * 5, "absent"] for name in result["absent"]]
    common.print_table(COLUMNS, cells, _notes(result))


def _cells(row):
    compile_s, median, fraction = row["compile_s"], row["median"], row["fraction"]
    return [
        row["name"],
        f"{row['num_envs']:,}",
        "–" if compile_s is None else f"{compile_s:.1f}",
        common.rate(median),
        f"{common.rate(row['low'])}–{common.rate(row['high'])}",
        common.rate(RK4_STEPS * median),
        "–" if fraction is None else f"{100 * fraction:.3g} %",
    ]


def _notes(result):
    cores, ceilings = result["cores"], result["ceilings"]
    yield (
        f"Medians of {len(result['rows'][0]['repeats'])}, on {cores} core{'s' * (cores > 1)}; an "
        f"agent step is {RK4_STEPS} RK4 steps (frameskip 20); compile time apart."
    )
    for name, reason in result["absent"].items():
        yield f"{name}: {reason}"
    if not ceilings:
        return
    full, physics = (common.rate(value) for value in ceilings.values())
    yield (
        f"of C: of the C code with {REFERENCE:,} spacecraft on one core at the same moment; at its "
        f"best {full} (full step) and {physics} (physics)."
    )
    if next(iter(ceilings.values())) < CEILING:
        yield (
            f"That {full} is below {common.rate(CEILING)} (another processor, or a busy one): as "
            f"a ceiling it is too low."
        )


if __name__ == "__main__":
    sys.exit(main())
