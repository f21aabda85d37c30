"""Flights of policies that try to break the limits, under run-time assurance: how many do.

Each condition of the robustness ladder, some with keep-out cones, and some at 40 Hz. What is
counted is the peak rate of the inertia that flies, which bounds ‖ω‖ between decisions, the wheels'
speeds, and the angles from the cones less what the body can have turned between two decisions.

Example:
    python benchmarks/assurance.py --flights 1000000 --part 1 --parts 2 --json one.json
    python benchmarks/assurance.py --flights 1000000 --part 2 --parts 2 --json two.json
    python benchmarks/assurance.py --rows one.json,two.json

One that was stopped goes on: conditions that its file has are not flown again.
"""

import dataclasses
import json
import os
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import common

from attjax import errors
from attjax.config import command_line

CONES = (
    {"axis": (0, 0, 1), "direction": (1, 0, 0), "half_angle_deg": 30},
    {"axis": (1, 0, 0), "direction": (0, -1, 1), "half_angle_deg": 20},
)
"""A star tracker along z that the Sun must not come near to, and something along x."""

WITH_CONES = (
    "ideal", "each moment ±20 %", "principal axes turned by 5°", "torques turned by 5°, ±5 %",
    "constant torque of 0.001 N m", 'noise of 5" and 0.0001 rad/s', "delay of one period",
    "cubesat-6u",
)  # fmt: skip
DURATION = 15.0
"""s, of a flight: several times as long as from rest to a limit."""

FAST = ("ideal", "each moment ±20 %", "noise, delay, inertia and torque together", "lm50-leo")
"""Conditions that are flown with cones as well, and at 40 Hz as well."""


PRETRAINED = Path(__file__).resolve().parents[1] / "pretrained" / "precise"


class Condition(NamedTuple):
    """What is flown: a name, the simulator, cones."""

    name: str
    env: Any
    keep_out: tuple


def parse_arguments(argv=None):
    """The command line."""
    parser = common.parser(__doc__)
    command_line.add_number(parser, "flights", int, 10**6, "in all", low=1)
    command_line.add_number(parser, "part", int, 1, "of the conditions that is flown", low=1)
    command_line.add_number(parser, "parts", int, 1, "that the conditions are shared into", low=1)
    parser.add_argument("--rows", help="print what these files say, separated by commas")
    return parser.parse_args(argv)


def conditions() -> list[Condition]:
    """All that are flown."""
    from attjax import AttitudeEnv
    from attjax.evaluation.ladder import conditions as ladder
    from attjax.evaluation.robustness import environment
    from attjax.world import KeepOut

    cones = tuple(KeepOut(**cone) for cone in CONES)
    found = []
    for frameskip, hertz in ((20, "11.43 Hz"), (5, "40 Hz")):
        env = AttitudeEnv(frameskip)
        for name, world in ladder(env.spacecraft, frameskip).items():
            flown = _short(environment(env, world))
            if frameskip == 20 or name in FAST:
                found.append(Condition(f"{name}, {hertz}", flown, ()))
            if name in (WITH_CONES if frameskip == 20 else FAST[:2]):
                found.append(Condition(f"{name}, cones, {hertz}", flown, cones))
    started = _short(AttitudeEnv(20, initial_state=turning))
    return [*found, Condition("ideal, from any rate, 11.43 Hz", started, ())]


def _short(env):
    craft = dataclasses.replace(env.spacecraft, duration=DURATION)
    return dataclasses.replace(env, spacecraft=craft)


def turning(key, params):
    """A random start with a peak rate up to what is assured."""
    import jax
    import jax.numpy as jnp

    from attjax.control.assured import ROOM
    from attjax.dynamics import rigid_body
    from attjax.envs import initial_state

    state = initial_state.initial_state(key, params)
    direction, share = jax.random.split(jax.random.fold_in(key, 1))
    rate = jax.random.normal(direction, (3,))
    wanted = (1 - 1.01 * ROOM) * params.rate_limit * jax.random.uniform(share)
    rate = rate * wanted / rigid_body.peak_rate(rate, params.inertia)
    return state.replace(angular_velocity=jnp.asarray(rate, params.inertia.dtype))


def policies(condition: Condition, cones: Any) -> dict:
    """Scores of the actions, by the names of who gives them."""
    import jax

    from attjax.control import adversaries
    from attjax.runs.flight import network

    partial = jax.tree_util.Partial
    found = {
        "fastest": partial(adversaries.fastest),
        "random": partial(adversaries.at_random, jax.random.key(1)),
    }
    if cones is not None:
        found["into the cones"] = partial(adversaries.into_cones, cones)
    if condition.name.startswith(FAST):
        policy, params = network(PRETRAINED)
        found["precise"] = partial(policy.scores, params)
    return found


def fly(condition: Condition, flights: int, seed: int) -> list[dict]:
    """A row for each policy."""
    import jax
    import numpy as np

    from attjax import flight_loop
    from attjax.control.assured import assurance
    from attjax.evaluation.limits import limits, nearness

    start = time.monotonic()
    env, within = condition.env, limits(condition.env, condition.keep_out)
    assured = assurance(env, condition.keep_out)
    names = policies(condition, within.cones)
    crew = tuple(flight_loop(None, assurance=assured, scores=x) for x in names.values())
    flown = nearness(crew, env, within, jax.random.key(seed), flights)
    need = 0.0 if within.cones is None else float(within.cones.per_rate * assured.reserve)
    rows = []
    for name, near in zip(names, flown):
        begun = near.started > need if within.cones is not None else np.zeros(flights, bool)
        broken = {
            "rate": near.rate > 1,
            "wheels": near.wheels > 1,
            "cones": begun & (near.clearance < 0),
        }
        rows.append({
            "condition": condition.name,
            "policy": name,
            "proved": bool(assured.is_certain),
            "level": float(assured.limit) / env.spacecraft.rate_limit,
            "flights": flights,
            "flights_from_without_cones": int(begun.sum()),
            "broken": {x: int(y.sum()) for x, y in broken.items()},
            "most_rate": float(near.rate.max()),
            "most_wheels": float(near.wheels.max()),
            "least_clearance_deg": (
                float(np.rad2deg(near.clearance[begun].min())) if begun.any() else None
            ),
            "most_error": float(near.error.max()),
            "error_bound": float(assured.error),
            "seconds": time.monotonic() - start,
        })  # fmt: skip
    jax.clear_caches()  # all conditions' programs need more memory maps than a process is given
    return rows


@errors.program("assurance.py")
def main(argv=None) -> int:
    """Fly, write and print."""
    arguments = parse_arguments(argv)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with errors.one_line_errors():
        if arguments.rows:
            files = [Path(x) for x in arguments.rows.split(",")]
            print_rows([row for file in files for row in json.loads(file.read_text())])
            return 0
        every = conditions()
        flights = -(-arguments.flights // sum(2 + bool(x.keep_out) for x in every))
        rows = flown_before(arguments.json, flights)
        there = {row["condition"] for row in rows}
        for number, condition in enumerate(every):
            is_ours = number % arguments.parts == arguments.part - 1
            if is_ours and condition.name not in there:
                rows += fly(condition, flights, number)
                print(f"{rows[-1]['seconds']:6.1f} s  {condition.name}", file=sys.stderr)
                common.write_json(arguments.json, rows)
    print_rows(rows)
    return 0


def flown_before(file: Path | None, flights: int) -> list[dict]:
    """The rows of a file that a run has written which was stopped; none if there is no such file.

    Raises:
        UserError: it holds something else, or another number of flights.
    """
    if file is None or not file.exists():
        return []
    try:
        rows = json.loads(file.read_text())
        counts = {row["flights"] for row in rows if row["condition"]}
    except (ValueError, KeyError, TypeError):
        raise errors.UserError(f"--json {file} is there, and holds no rows of flights") from None
    if counts - {flights}:
        raise errors.UserError(f"--json {file} has rows of other than {flights:,} flights each")
    return rows


def print_rows(rows: list[dict]) -> None:
    """Print a row for each condition and policy, and what was broken in all."""
    from attjax.evaluation.robustness import wilson

    columns = ["", "policy", "flights", "broken", "rate", "wheels", "cone (°)"]
    print_row = [
        [
            row["condition"] + ("" if row["proved"] else " *"),
            row["policy"],
            f"{row['flights']:,}",
            f"{sum(row['broken'].values())}",
            f"{row['most_rate']:.4f}",
            f"{row['most_wheels']:.3f}",
            "" if row["least_clearance_deg"] is None else f"{row['least_clearance_deg']:.2f}",
        ]
        for row in rows
    ]
    common.print_table(columns, print_row)
    for name, chosen in (("proved", True), ("not proved (*)", False)):
        of_these = [row for row in rows if row["proved"] == chosen]
        flights = sum(row["flights"] for row in of_these)
        if flights:
            broken = sum(sum(row["broken"].values()) for row in of_these)
            most = wilson(broken / flights, flights)[1]
            print(f"{name}: {broken} broken of {flights:,} flights; at most {most:.2g} (95 %)")


if __name__ == "__main__":
    sys.exit(main())
