"""How throughput and memory of the simulator grow with spacecraft and cores, and training's.

Each figure is of a process of its own, so that its peak memory and its cores are its own.

Example:
    python benchmarks/scaling.py --json scaling.json
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time

import common

from attjax import errors
from attjax.config import command_line

NUM_ENVS = (2048, 8192, 32768, 131072, 524288, 1048576)
NETWORKS = ((400, 300), (64, 64))
REPEAT_S = 0.3
TRAINING_BLOCKS = 5
MEBIBYTE = 2**20
SPEED_COLUMNS = ("\ncores", "start\n(s)", "compile\n(s)", "agent-\nsteps/s", "\nrange")
MEMORY_NOTE = "Peak memory is the whole process's, with Python, JAX and the compiler."


def parse_arguments(argv):
    """The command line; --child is for the processes that this script starts."""
    parser = common.parser(__doc__)
    common.add_num_envs(parser, NUM_ENVS)
    command_line.add_number(parser, "repeats", int, 7, "measurements of each figure", low=1)
    command_line.add_number(parser, "cores", int, 2, "compare one core and that many", low=1)
    parser.add_argument(
        "--minibatch-size",
        type=common.positive_integers,
        default=[1024, 2048],
        metavar="N,N,...",
        help="of the trainings (default: 1024,2048)",
    )
    parser.add_argument("--no-training", action="store_true", help="the simulator only")
    parser.add_argument("--child", type=json.loads, help=argparse.SUPPRESS)
    return parser.parse_args(argv)


@errors.program("scaling.py")
def main(argv=None) -> int:
    """Run the benchmark; returns the exit status."""
    arguments = parse_arguments(argv)
    if arguments.child is not None:
        print(json.dumps(child(**arguments.child)))
        return 0
    with errors.one_line_errors():
        check(arguments)
    machine = common.machine()
    common.print_machine(machine)
    cores = sorted({1, arguments.cores})
    simulator = [
        start_child(kind="simulator", num_envs=n, cores=c, repeats=arguments.repeats)
        for n in arguments.num_envs
        for c in cores
    ]
    print_simulator(simulator, arguments.cores)
    training = []
    if not arguments.no_training:
        training = [
            start_child(kind="training", hidden_sizes=sizes, minibatch_size=size, cores=c)
            for sizes in NETWORKS
            for size in arguments.minibatch_size
            for c in cores
        ]
        print_training(training, arguments.cores)
    result = {"machine": machine, "simulator": simulator, "training": training}
    common.write_json(arguments.json, result)
    return 0


def check(arguments) -> None:
    """Refuse what the machine or the cores do not allow."""
    allowed = len(os.sched_getaffinity(0))
    if arguments.cores > allowed:
        raise errors.UserError(f"--cores is {arguments.cores}; it must be at most {allowed} here")
    uneven = [n for n in arguments.num_envs if n % arguments.cores]
    if uneven:
        raise errors.UserError(
            f"--num-envs has {uneven[0]}, not a multiple of --cores, {arguments.cores}"
        )


def start_child(**task) -> dict:
    """Measure in a process of its own; returns the task and the figures."""
    command = [sys.executable, __file__, "--child", json.dumps({"launched": time.time(), **task})]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    print(*(f"{key} {value}" for key, value in task.items()), "done", sep=", ", file=sys.stderr)
    return {**task, **json.loads(done.stdout)}


def child(launched: float, kind: str, cores: int, **task) -> dict:
    """Measure in this process, on that many cores; start_s is until JAX has its devices."""
    common.restrict_to_cores(cores)
    import jax

    jax.config.update("jax_platforms", "cpu")
    jax.config.update("jax_num_cpu_devices", cores)
    jax.devices()
    start_s = time.time() - launched
    figures = {"simulator": fly, "training": train}[kind](cores=cores, **task)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return {**figures, "start_s": start_s, "peak_bytes": peak}


def fly(num_envs: int, cores: int, repeats: int) -> dict:
    """Throughput of the fused rollout."""
    import rollouts

    flight = rollouts.fused(num_envs, cores)
    rates = common.measure({"": flight}, repeats, REPEAT_S)[""]
    return {"compile_s": flight.compile_s, **common.summary(rates)}


def train(hidden_sizes: list[int], minibatch_size: int, cores: int) -> dict:
    """Throughput of training with the default preset, in blocks of one update."""
    import jax

    from attjax import ppo
    from attjax.config import presets
    from attjax.ppo import train_state
    from attjax.runs import build

    changes = {"hidden_sizes": tuple(hidden_sizes), "minibatch_size": minibatch_size}
    settings = presets.PRECISE.replace(**changes)
    setup = build.setup(settings, num_devices=cores)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    durations = []
    for _ in range(1 + TRAINING_BLOCKS):
        start = time.perf_counter()
        state, _ = jax.block_until_ready(ppo.train_block(setup, env_params, state, 1))
        durations.append(time.perf_counter() - start)
    rates = [settings.ppo.steps_per_update / duration for duration in durations[1:]]
    return {"compile_s": durations[0] - min(durations[1:]), **common.summary(rates)}


def print_simulator(rows: list[dict], cores: int) -> None:
    """Print throughput and memory against numbers of spacecraft and cores."""
    print("Simulator, fused rollout (frameskip 20)")
    best = {c: max(r["median"] for r in rows if r["cores"] == c) for c in (1, cores)}
    columns = ["\nspacecraft", *SPEED_COLUMNS]
    columns += ["of\nbest", f"{cores} cores\nover 1", "peak\nMiB"]
    cells = []
    for row in rows:
        of_best = f"{100 * row['median'] / best[row['cores']]:.0f} %"
        cells.append([f"{row['num_envs']:,}", *_speed(row), of_best, *_gain(rows, row, "num_envs")])
    common.print_table(columns, cells, [f"of best: of the best on as many cores. {MEMORY_NOTE}"])


def print_training(rows: list[dict], cores: int) -> None:
    """Print throughput of training against networks and cores."""
    print("\nTraining, default preset")
    columns = ["hidden\nlayers", "mini-\nbatch", *SPEED_COLUMNS]
    columns += [f"{cores} cores\nover 1", "peak\nMiB"]
    cells = []
    for row in rows:
        name = "-".join(map(str, row["hidden_sizes"]))
        gain = _gain(rows, row, "hidden_sizes", "minibatch_size")
        cells.append([name, str(row["minibatch_size"]), *_speed(row), *gain])
    common.print_table(columns, cells, [MEMORY_NOTE])


def _speed(row):
    return [
        str(row["cores"]),
        f"{row['start_s']:.1f}",
        f"{row['compile_s']:.1f}",
        common.rate(row["median"]),
        f"{common.rate(row['low'])}–{common.rate(row['high'])}",
    ]


def _gain(rows, row, *keys):
    """Ratio to the same on one core, and peak memory."""
    one = next(r for r in rows if r["cores"] == 1 and all(r[k] == row[k] for k in keys))
    gain = "" if row["cores"] == 1 else f"{row['median'] / one['median']:.2f}"
    return [gain, f"{row['peak_bytes'] / MEBIBYTE:,.0f}"]


if __name__ == "__main__":
    sys.exit(main())
