"""Training throughput on one core, beside other PPOs and what the matrix products allow.

All train the paper's task (frameskip 20, Eq. 12-13, 11 numbers, 19 actions) with two separate
networks, the same steps, passes and minibatches; one update is timed, compilation apart. All
take turns. Each is shown at its best minibatch size. The ceiling does the matrix products of
the update alone. A peer runs in its own environment; one that is missing is a row that says so.

    python -m venv rejax && rejax/bin/pip install --editable . rejax
    python -m venv sb3 && sb3/bin/pip install -e . torch stable-baselines3 gymnasium

Example:
    python benchmarks/training.py --rejax-python rejax/bin/python --sb3-python sb3/bin/python
"""

import contextlib
import dataclasses
import os
import sys
from pathlib import Path

import common
from contenders import Contender, Peer, PeerError, Workload, measure, with_rates

from attjax import errors

MORE_PASSES = 10
"""Passes at which attjax is compared with Stable-Baselines3, whose default they are."""

FOLDER = Path(__file__).parent
RUNNERS = {"rejax": "rejax_runner.py", "Stable-Baselines3": "sb3_runner.py"}
COLUMNS = [
    "", "passes", "minibatch", "compile (s)", "agent-steps/s", "range", "CPU", "of ceiling",
    "attjax / it",
]  # fmt: skip
NOTES = [
    "one core; range: lowest and highest repeat; CPU: its time over wall time, 1 if undisturbed"
]
AS_THE_OTHERS = {
    "greedy_share": 0.0, "near_goal_share": 0.0, "rate_margin": 0.0, "time_limit_terminates": True,
}  # fmt: skip
"""Settings of paper-fast that other trainers have no word for, put back to what they do."""

ROLLOUT, PASS, CEILING = "products of a rollout", "products of a pass", "ceiling"


def parse_arguments(argv=None):
    """The command line."""
    parser = common.parser(__doc__)
    parser.add_argument("--hidden-sizes", type=integers, default=(400, 300), metavar="N,N,...")
    parser.add_argument("--num-envs", type=int, default=2048, metavar="N")
    parser.add_argument("--rollout-length", type=int, default=64, metavar="N")
    parser.add_argument("--passes", type=int, default=4, metavar="N")
    sizes = (512, 1024, 2048, 4096)
    parser.add_argument("--minibatch-size", type=integers, default=sizes, metavar="N,N,...")
    parser.add_argument("--repeats", type=int, default=5, metavar="N")
    sb3_help = "as its updates take minutes (default: 2)"
    parser.add_argument("--sb3-repeats", type=int, default=2, metavar="N", help=sb3_help)
    for name in ("rejax", "sb3"):
        python_help = f"interpreter that has {name} (default: this one)"
        parser.add_argument(f"--{name}-python", default=sys.executable, help=python_help)
    return parser.parse_args(argv)


def integers(text: str) -> tuple[int, ...]:
    """An argparse type: N,N,..."""
    return tuple(int(part) for part in text.split(","))


@errors.program("training.py")
def main(argv=None) -> int:
    """Measure all contenders and print the table."""
    arguments = parse_arguments(argv)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    common.restrict_to_cores(1)
    few = workloads(arguments, arguments.passes)
    many = workloads(arguments, MORE_PASSES)
    results = [
        *few_passes(few, arguments.rejax_python, arguments.repeats),
        *many_passes(many, arguments.sb3_python, arguments.sb3_repeats),
    ]
    machine = common.machine()
    common.print_machine(machine)
    print_table(results)
    common.write_json(arguments.json, {"machine": machine, "results": results})
    return 0


def workloads(arguments, passes: int) -> list[Workload]:
    """One for each minibatch size."""
    sizes, envs, length = arguments.hidden_sizes, arguments.num_envs, arguments.rollout_length
    return [Workload(sizes, envs, length, passes, size) for size in arguments.minibatch_size]


def few_passes(workloads: list[Workload], rejax_python: str, repeats: int) -> list[dict]:
    """Results of attjax, PureJaxRL's shape, rejax and the ceiling."""
    import purejaxrl_shape

    ours = [Contender("attjax", w, prepare_attjax) for w in workloads]
    theirs = [Contender("PureJaxRL's shape", w, purejaxrl_shape.prepare) for w in workloads]
    return in_turns([*ours, *theirs], "rejax", rejax_python, workloads, repeats)


def many_passes(workloads: list[Workload], sb3_python: str, repeats: int) -> list[dict]:
    """Results of attjax, Stable-Baselines3 and the ceiling."""
    ours = [Contender("attjax", w, prepare_attjax) for w in workloads]
    return in_turns(ours, "Stable-Baselines3", sb3_python, workloads, repeats)


def in_turns(contenders, peer_name, python, workloads, repeats) -> list[dict]:
    """Results of the contenders, of the peer or why there are none, and of the ceiling."""
    import matrix_products

    products = [Contender(ROLLOUT, workloads[0], matrix_products.prepare_rollout)]
    products += [Contender(PASS, w, matrix_products.prepare_pass) for w in workloads]
    others, versions = [*contenders, *products], {}
    try:
        peer = Peer(python, FOLDER / RUNNERS[peer_name])
    except PeerError as error:
        reason = "not installed" if "ModuleNotFoundError" in str(error) else str(error)
        results, absent = measure(others, repeats), [{"name": peer_name, "failure": reason}]
    else:
        peers = [Contender(peer_name, w, peer.prepare, peer.processor_s) for w in workloads]
        with contextlib.closing(peer):
            results, absent = measure([*peers, *others], repeats), []
        versions = {"versions": peer.versions}
    count = len(products)
    ceilings = [ceiling(results[-count:], workload) for workload in workloads]
    trainers = [r | versions if r["name"] == peer_name else r for r in results[:-count]]
    return [*trainers, *absent, *ceilings]


def prepare_attjax(workload: Workload):
    """A function that runs one update of train.py's program."""
    import jax

    from attjax import ppo
    from attjax.config import presets
    from attjax.ppo import train_state
    from attjax.runs import build

    settings = presets.PAPER_FAST.replace(**AS_THE_OTHERS, **dataclasses.asdict(workload))
    setup = build.setup(settings)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    train_block = ppo.train_block.lower(setup, env_params, state, 1).compile()

    def update():
        nonlocal state
        state, _ = jax.block_until_ready(train_block(env_params, state, 1))

    return update


def ceiling(products: list[dict], workload: Workload) -> dict:
    """An update made of products alone: a rollout and the passes, round by round."""
    rollout = next(p for p in products if p["name"] == ROLLOUT)
    one_pass = next(
        p for p in products if (p["name"], p["minibatch_size"]) == (PASS, workload.minibatch_size)
    )
    parts = {"compile_s": rollout["compile_s"] + one_pass["compile_s"]}
    for clock in ("update_s", "cpu_s"):
        pairs = zip(rollout[clock], one_pass[clock])
        parts[clock] = [a + workload.passes * b for a, b in pairs]
    return with_rates({"name": CEILING} | dataclasses.asdict(workload) | parts)


def best_of_each(results: list[dict]) -> dict[tuple[str, int], dict]:
    """By name and passes, the result with the highest median."""
    best = {}
    for result in results:
        key = result["name"], result.get("passes")
        if key not in best or median(result) > median(best[key]):
            best[key] = result
    return best


def median(result):
    """Agent-steps/s; 0 where nothing was measured."""
    return result.get("steps_per_s", {"median": 0})["median"]


def print_table(results: list[dict]) -> None:
    """Each contender at its best minibatch size, beside the ceiling at its best and attjax."""
    best, rows = best_of_each(results), []
    for (name, passes), result in sorted(best.items(), key=lambda item: item[0][1] or 0):
        if "failure" in result:
            rows.append([f"{name}: {result['failure']}", *["–"] * 8])
            continue
        steps_per_s = result["steps_per_s"]
        rows.append(
            [
                name,
                str(passes),
                str(result["minibatch_size"]),
                f"{result['compile_s']:.1f}",
                common.rate(median(result)),
                f"{common.rate(steps_per_s['low'])}–{common.rate(steps_per_s['high'])}",
                f"{sum(result['cpu_s']) / sum(result['update_s']):.2f}",
                f"{median(result) / median(best[CEILING, passes]):.2f}",
                f"{median(best['attjax', passes]) / median(result):.2f}",
            ]
        )
    common.print_table(COLUMNS, rows, NOTES)


if __name__ == "__main__":
    sys.exit(main())
