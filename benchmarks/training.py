"""Training throughput, beside other PPOs and what the matrix products allow.

All train the paper's task (frameskip 20, Eq. 12-13, 11 numbers, 19 actions) with two separate
networks, the same steps, passes and minibatches; one update is timed, compilation apart. All
take turns. Each is shown at its best minibatch size. The ceiling does the matrix products of
the update alone. A peer runs in its own environment; one that is missing is a row that says so.

    python -m venv rejax && rejax/bin/pip install --editable . rejax
    python -m venv sb3 && sb3/bin/pip install --editable . gymnasium stable-baselines3 sbx-rl
    python -m venv pure && pure/bin/pip install --editable . gymnax distrax brax navix
    git clone https://github.com/luchris429/purejaxrl

Example:
    python benchmarks/training.py --rejax-python rejax/bin/python --sb3-python sb3/bin/python
    python benchmarks/training.py --hidden-sizes 64,64 --cores 2 --purejaxrl purejaxrl/purejaxrl \
        --purejaxrl-python pure/bin/python --sbx-python sb3/bin/python
"""

import contextlib
import dataclasses
import os
import sys
from pathlib import Path

import common
from contenders import Contender, Peer, PeerError, Workload, measure, with_rates
from training_table import CEILING, print_table

from attjax import errors
from attjax.config import command_line

MORE_PASSES = 10
"""Passes at which attjax is compared with Stable-Baselines3 and SBX, whose default they are."""

PUREJAXRL_SIZES = (64, 64)
FOLDER = Path(__file__).parent
AS_THE_OTHERS = {
    "greedy_share": 0.0, "near_goal_share": 0.0, "rate_margin": 0.0, "time_limit_terminates": True,
}  # fmt: skip
"""Settings of paper-fast that other trainers have no word for, put back to what they do."""

ROLLOUT, PASS = "products of a rollout", "products of a pass"


@dataclasses.dataclass(frozen=True)
class Script:
    """How a peer is started: an interpreter, a file of this folder, and that file's argument."""

    python: str
    runner: str
    argument: str = ""

    def start(self) -> Peer:
        """The peer. Raises: PeerError, as :class:`Peer`."""
        return Peer(self.python, FOLDER / self.runner, self.argument)


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
    sb3_help = f"of what takes {MORE_PASSES} passes, as those updates take minutes (default: 2)"
    parser.add_argument("--sb3-repeats", type=int, default=2, metavar="N", help=sb3_help)
    command_line.add_number(parser, "cores", int, 1, "processor cores for each of them", low=1)
    for name in ("rejax", "sb3", "sbx", "purejaxrl"):
        python_help = f"interpreter that has {name} or what it needs (default: this one)"
        parser.add_argument(f"--{name}-python", default=sys.executable, help=python_help)
    purejaxrl_help = "folder with PureJaxRL's ppo.py and wrappers.py (default: left out)"
    parser.add_argument("--purejaxrl", metavar="FOLDER", help=purejaxrl_help)
    return parser.parse_args(argv)


def integers(text: str) -> tuple[int, ...]:
    """An argparse type: N,N,..."""
    return tuple(int(part) for part in text.split(","))


@errors.program("training.py")
def main(argv=None) -> int:
    """Measure all contenders and print the table."""
    arguments = parse_arguments(argv)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with errors.one_line_errors():
        common.restrict_to_cores(arguments.cores)
        few_peers, many_peers = peers(arguments)
    import jax

    jax.config.update("jax_num_cpu_devices", arguments.cores)
    few = workloads(arguments, arguments.passes)
    many = workloads(arguments, MORE_PASSES)
    results = [
        *in_turns([*ours(few), *pure_jax_rl_shape(few)], few_peers, few, arguments.repeats),
        *in_turns(ours(many), many_peers, many, arguments.sb3_repeats),
    ]
    machine = common.machine()
    common.print_machine(machine)
    print_table(results, arguments.cores)
    measured = {"machine": machine, "cores": arguments.cores, "results": results}
    common.write_json(arguments.json, measured)
    return 0


def peers(arguments) -> tuple[dict[str, Script], dict[str, Script]]:
    """By name, those that are measured at --passes and those at MORE_PASSES.

    Raises:
        UserError: --purejaxrl is no folder with its files, or the networks are not its own.
    """
    few = {"rejax": Script(arguments.rejax_python, "rejax_runner.py")}
    if arguments.purejaxrl is not None:
        if not Path(arguments.purejaxrl, "ppo.py").is_file():
            raise errors.UserError(f"--purejaxrl is {arguments.purejaxrl}; no ppo.py is in it")
        if arguments.hidden_sizes != PUREJAXRL_SIZES:
            raise errors.UserError("--purejaxrl has networks of 64-64; give --hidden-sizes 64,64")
        few["PureJaxRL"] = Script(
            arguments.purejaxrl_python, "purejaxrl_runner.py", arguments.purejaxrl
        )
    many = {
        "Stable-Baselines3": Script(arguments.sb3_python, "sb3_runner.py"),
        "SBX": Script(arguments.sbx_python, "sbx_runner.py"),
    }
    return few, many


def workloads(arguments, passes: int) -> list[Workload]:
    """One for each minibatch size."""
    sizes, envs, length = arguments.hidden_sizes, arguments.num_envs, arguments.rollout_length
    return [Workload(sizes, envs, length, passes, size) for size in arguments.minibatch_size]


def ours(workloads: list[Workload]) -> list[Contender]:
    """The same workloads, by attjax."""
    return [Contender("attjax", w, prepare_attjax) for w in workloads]


def pure_jax_rl_shape(workloads: list[Workload]) -> list[Contender]:
    """A trainer of PureJaxRL's shape."""
    import purejaxrl_shape

    return [Contender("PureJaxRL's shape", w, purejaxrl_shape.prepare) for w in workloads]


def in_turns(
    contenders: list[Contender], scripts: dict[str, Script], workloads: list[Workload], repeats: int
) -> list[dict]:
    """Results of the contenders, of the peers or why there are none, and of the ceiling."""
    import matrix_products

    products = [Contender(ROLLOUT, workloads[0], matrix_products.prepare_rollout)]
    products += [Contender(PASS, w, matrix_products.prepare_pass) for w in workloads]
    found, absent, versions = [], [], {}
    with contextlib.ExitStack() as running:
        for name, script in scripts.items():
            try:
                peer = running.enter_context(contextlib.closing(script.start()))
            except PeerError as error:
                reason = "not installed" if "ModuleNotFoundError" in str(error) else str(error)
                absent.append({"name": name, "failure": reason})
                continue
            versions[name] = {"versions": peer.versions}
            found += [Contender(name, w, peer.prepare, peer.processor_s) for w in workloads]
        results = measure([*found, *contenders, *products], repeats)
    count = len(products)
    ceilings = [ceiling(results[-count:], workload) for workload in workloads]
    trainers = [r | versions.get(r["name"], {}) for r in results[:-count]]
    return [*trainers, *absent, *ceilings]


def prepare_attjax(workload: Workload):
    """A function that runs one update of train.py's program."""
    import jax

    from attjax import ppo
    from attjax.config import presets
    from attjax.ppo import train_state
    from attjax.runs import build

    settings = presets.PAPER_FAST.replace(**AS_THE_OTHERS, **dataclasses.asdict(workload))
    setup = build.setup(settings, num_devices=build.num_devices(settings))
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


if __name__ == "__main__":
    sys.exit(main())
