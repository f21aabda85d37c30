"""Spacecraft whose torque axes are askew, which ``universal`` has never trained on.

python benchmarks/askew.py --controller pretrained/universal

The spacecraft of ``eval.py --fleet``, with the directions of their three torques drawn anew: a line
for each range of the volume that unit vectors along them span, 1 where they are orthogonal.
"""

import argparse
import json
import sys

import jax
import jax.numpy as jnp
import numpy as np
from adaptation import controller_of

from attjax import AttitudeEnv, errors
from attjax.evaluation import statistics
from attjax.evaluation.episodes import fly
from attjax.evaluation.fleets import params_of, ratios

VOLUMES = ((1.0, 1.0), (0.7, 1.0), (0.4, 0.7), (0.2, 0.4))


def parse_arguments(argv=None):
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--controller", default="phase-plane", help="a law's name, or a checkpoint")
    parser.add_argument("--frameskip", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(argv)


@errors.program("askew.py")
def main(argv=None) -> int:
    """Fly and print."""
    given = parse_arguments(argv)
    with errors.one_line_errors():
        law, _ = controller_of(given.controller, adapts=False)
        pilot, env = jax.tree_util.Partial(law), AttitudeEnv(given.frameskip)
        key, fleet = jax.random.key(given.seed), params_of(env, given.episodes, given.seed)
        random = np.random.default_rng(given.seed)
        for volumes in VOLUMES:
            axes = directions(random, volumes, given.episodes)
            table = jnp.asarray(np.asarray(fleet.torque_table) @ axes, fleet.torque_table.dtype)
            params = fleet.replace(torque_table=table)
            flown = fly(pilot, env, params, key, given.episodes)
            judged = statistics(flown, env, params)
            row = {x: judged[x] for x in ("success_rate", "overspeed_rate")}
            row = {"volume": volumes, "episodes": given.episodes} | row
            row |= ratios(flown, env, params, key)
            print(json.dumps(row), flush=True)
    return 0


def directions(random, volumes, count):
    """(count, 3, 3) unit vectors, rows, that span volumes between two; the body axes, if of 1."""
    least, most = volumes
    if least == 1:
        return np.broadcast_to(np.eye(3), (count, 3, 3))
    found = np.empty((0, 3, 3))
    while len(found) < count:
        drawn = random.normal(size=(4 * count, 3, 3))
        drawn /= np.linalg.norm(drawn, axis=2, keepdims=True)
        volume = abs(np.linalg.det(drawn))
        found = np.concatenate([found, drawn[(volume >= least) & (volume <= most)]])
    return found[:count]


if __name__ == "__main__":
    sys.exit(main())
