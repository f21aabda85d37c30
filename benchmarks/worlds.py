"""What imperfect worlds and the flight loop cost, against the ideal world's step.

A scan of ``vmap(step_env)`` by a user, in one world after the other, taking turns; compilation
apart. A world "with flight loop" has an estimator and a predictor in it, which decide on nothing.

Example:
    python benchmarks/worlds.py --cores 1 --repeats 9
"""

import dataclasses
import os
import sys

import common

from attjax import errors
from attjax.config import command_line
from attjax.world import IDEAL, World

STEPS = 50
LOW_ORBIT = "lm50-leo"


def parse_arguments(argv=None):
    """The command line."""
    parser = common.parser(__doc__)
    command_line.add_number(parser, "num-envs", int, 512, "spacecraft", low=1)
    command_line.add_number(parser, "cores", int, 1, "processor cores", low=1)
    command_line.add_number(parser, "repeats", int, 9, "flights of each", low=1)
    command_line.add_number(parser, "frameskip", int, 20, "RK4 steps after the first", low=0)
    return parser.parse_args(argv)


def worlds() -> dict[str, World]:
    """By name: the ideal one, each kind of imperfection of a low orbit, and all of it."""
    whole = World.named(LOW_ORBIT)
    parts = {
        "torques and inertia": ("actuators", "uncertainty"),
        "disturbances": ("orbit", "disturbances"),
        "sensors": ("sensors",),
    }
    found = {"ideal": IDEAL}
    for name, kept in parts.items():
        gone = {x: None for one in parts.values() for x in one if x not in kept}
        found[name] = dataclasses.replace(whole, name=name, **gone)
    return found | {LOW_ORBIT: whole}


@errors.program("worlds.py")
def main(argv=None) -> int:
    """Measure and print the table."""
    arguments = parse_arguments(argv)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with errors.one_line_errors():
        common.restrict_to_cores(arguments.cores)
        size = arguments.frameskip, arguments.num_envs
        flights = {name: flight(world, False, *size) for name, world in worlds().items()}
        flights[f"{LOW_ORBIT}, with flight loop"] = flight(World.named(LOW_ORBIT), True, *size)
    rates = common.measure(flights, arguments.repeats, repeat_s=0.2)
    machine = common.machine()
    common.print_machine(machine)
    rows = [row(name, flights[name], of_this, rates["ideal"]) for name, of_this in rates.items()]
    columns = ["", "ns a step", "of the\nideal", "range", "compiled\n(s)"]
    common.print_table(columns, rows)
    common.write_json(arguments.json, {"machine": machine, "rates": rates})
    return 0


def row(name: str, one: common.Flight, rates: list[float], ideal: list[float]) -> list[str]:
    """A row of the table: the best time, and the share of the ideal world's rate turn by turn."""
    shares = sorted(rate / other for rate, other in zip(rates, ideal))
    middle = shares[len(shares) // 2]
    return [
        name,
        f"{1e9 / max(rates):.0f}",
        f"{middle:.3f}",
        f"{shares[0]:.3f}-{shares[-1]:.3f}",
        f"{one.compile_s:.1f}",
    ]


def flight(world: World, has_loop: bool, frameskip: int, num_envs: int) -> common.Flight:
    """A scan of steps in a world."""
    import jax
    import jax.numpy as jnp

    from attjax import AttitudeEnv, flight_loop
    from attjax.envs.parameters import measured
    from attjax.sharding import COMPILER_OPTIONS

    env = AttitudeEnv(frameskip, world=world)
    params = env.default_params
    loop = flight_loop(lambda observation, context: jnp.asarray(0, jnp.int32))
    context = env.context(params)
    keys = jax.random.split(jax.random.key(0), num_envs)
    states = jax.jit(jax.vmap(env.reset, (0, None)))(keys, params)[1]
    memory = jax.vmap(lambda _: loop.init(context))(keys) if has_loop else None

    def step(carry, _):
        memory, states = carry
        actions = jnp.zeros(num_envs, jnp.int32)
        if has_loop:
            told = jax.vmap(measured)(states)
            actions, memory = jax.vmap(loop.step, (0, 0, None))(memory, told, env.context(params))
        states = jax.vmap(env.step_env, (None, 0, 0, None))(keys[0], states, actions, params)[1]
        return (memory, states), None

    fly = jax.jit(
        lambda carry: jax.lax.scan(step, carry, None, length=STEPS)[0],
        compiler_options=COMPILER_OPTIONS,
    )
    compiled = None

    def compile_it():
        nonlocal compiled
        compiled = fly.lower((memory, states)).compile()

    compile_s = common.seconds(compile_it)
    call = lambda: jax.block_until_ready(compiled((memory, states)))  # noqa: E731
    return common.Flight(call, STEPS * num_envs, compile_s)


if __name__ == "__main__":
    sys.exit(main())
