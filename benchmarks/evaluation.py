"""Evaluation throughput, beside the matrix products of the policy's decisions alone.

Slews are flown as eval.py flies them; the products are of the policy's own kernels, for as many
decisions, in the same blocks on the same cores. Both take turns; compilation apart.

Example:
    python benchmarks/evaluation.py --checkpoint pretrained/precise --cores 2
"""

import os
import sys
from pathlib import Path

import common

from attjax import errors
from attjax.config import command_line, fields

FRAMESKIP = fields.TABLE_2
CHANGE = 1e-6
"""Of the inputs by a decision's largest output, so that no product stays the same."""


def parse_arguments(argv=None):
    """The command line."""
    parser = common.parser(__doc__)
    checkpoint_help = "folder of a run or of a pretrained policy"
    parser.add_argument("--checkpoint", type=Path, required=True, help=checkpoint_help)
    command_line.add_number(parser, "episodes", int, 2**14, "slews of a flight", low=1)
    command_line.add_number(parser, "cores", int, 1, "processor cores", low=1)
    command_line.add_number(parser, "repeats", int, 5, "flights of each", low=1)
    return parser.parse_args(argv)


@errors.program("evaluation.py")
def main(argv=None) -> int:
    """Measure both and print the table."""
    arguments = parse_arguments(argv)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with errors.one_line_errors():
        common.restrict_to_cores(arguments.cores)
        import jax

        from attjax.runs import checkpoint

        jax.config.update("jax_num_cpu_devices", arguments.cores)
        policy, params = checkpoint.restore_network(arguments.checkpoint)
        params = jax.device_get(params)  # to be placed on all devices
        flights = {
            "attjax": slews(policy, params, arguments.episodes),
            "products alone": products(params, arguments.episodes),
        }
    rates = common.measure(flights, arguments.repeats, repeat_s=0.5)
    shares = [ours / most for ours, most in zip(*rates.values())]
    machine = common.machine()
    common.print_machine(machine)
    print_table(flights, rates, shares, arguments.cores)
    common.write_json(arguments.json, {"machine": machine, "rates": rates, "shares": shares})
    return 0


def print_table(flights, rates, shares, cores: int) -> None:
    """Both, and the median of what the evaluation has of the products, flight by flight."""
    rows = []
    for name, share in (
        ("attjax", f"{common.summary(shares)['median']:.2f}"),
        (list(rates)[1], ""),
    ):
        found = common.summary(rates[name])
        between = "–".join(common.rate(found[end]) for end in ("low", "high"))
        compile_s = f"{flights[name].compile_s:.1f}"
        rows.append([name, compile_s, common.rate(found["median"]), between, share])
    columns = ["", "compile\n(s)", "agent-\nsteps/s", "range", "of the\nproducts"]
    note = f"Medians of {len(shares)}, cores: {cores}, frameskip {FRAMESKIP}."
    common.print_table(columns, rows, [note])


def slews(policy, params, episodes: int) -> common.Flight:
    """Whole slews under the policy, as eval.py flies them."""
    import jax

    from attjax import evaluation
    from attjax.envs.attitude import AttitudeEnv

    env = AttitudeEnv(FRAMESKIP)
    controller = jax.tree_util.Partial(policy.act, params)
    key = jax.random.key(0)
    steps = env.spacecraft.max_steps(FRAMESKIP)
    return timed(
        lambda: evaluation.fly(controller, env, env.default_params, key, episodes), episodes * steps
    )


def products(params, episodes: int) -> common.Flight:
    """The products of as many decisions, with a column for each slew as the policy has them."""
    import jax
    import jax.numpy as jnp

    from attjax import sharding
    from attjax.evaluation.episodes import SLEWS_TOGETHER
    from attjax.spacecraft import LM50

    layers = params["policy"]["params"]
    kernels = [layers[name]["kernel"].T for name in sorted(layers)]
    steps, num_devices = LM50.max_steps(FRAMESKIP), len(sharding.devices())
    blocks = -(-episodes // (SLEWS_TOGETHER * num_devices)) * num_devices
    shape = blocks, kernels[0].shape[1], SLEWS_TOGETHER
    inputs = jax.random.normal(jax.random.key(0), shape)

    def decide(_, x):
        y = x
        for kernel in kernels:
            y = jnp.matmul(kernel, y, precision="highest")
        return x + CHANGE * jnp.max(y, axis=0)

    def of_blocks(inputs):
        return jax.lax.map(lambda x: jax.lax.fori_loop(0, steps, decide, x), inputs)

    split = sharding.SPLIT
    program = jax.jit(
        sharding.on_devices(num_devices, of_blocks, (split,), split),
        compiler_options=sharding.COMPILER_OPTIONS,
    )
    return timed(lambda: jax.block_until_ready(program(inputs)), blocks * SLEWS_TOGETHER * steps)


def timed(call, agent_steps: int) -> common.Flight:
    """A flight of so many agent steps, with the time that its first call takes beyond the next."""
    first, again = common.seconds(call), common.seconds(call)
    return common.Flight(call, agent_steps, max(0.0, first - again))


if __name__ == "__main__":
    sys.exit(main())
