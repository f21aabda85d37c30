"""The classical laws with gains that are tuned by as many agent steps as ``universal`` trains by.

python benchmarks/tuned_laws.py

Gains are drawn at random about those of attjax.control.classical, and each set flies slews of
spacecraft that a training could have drawn. Half of the budget goes to many sets, the other half to
the best tenth of them. What the best of each law comes to, beside the gains that it has by default,
is then flown on the spacecraft of ``eval.py --fleet``, which no training draws; and on LM50.
"""

import argparse
import json

import jax
import jax.numpy as jnp
import numpy as np

from attjax import LM50, AttitudeEnv
from attjax.control.classical import CONTROLLERS, GAINS, Gains
from attjax.envs import fleet
from attjax.evaluation import evaluate, evaluate_fleet, settling_times, successes
from attjax.evaluation.episodes import fly

SETS, SPREAD = 60, 1.8
"""Of gains that are tried, the default among them; by what factor they differ at most."""


def main() -> None:
    """Tune, fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--agent-steps", type=int, default=200_000_000, help="for each law")
    parser.add_argument("--episodes", type=int, default=1000, help="of the last flights")
    given = parser.parse_args()
    env = AttitudeEnv(5)
    for name, law in CONTROLLERS.items():
        tuned = _tuned(law, env, given.agent_steps)
        for gains in (GAINS, tuned):
            flown = jax.tree_util.Partial(law, gains=gains)
            judged = evaluate_fleet(flown, env, episodes=given.episodes)
            row = {"controller": name, "gains": {k: float(x) for k, x in gains._asdict().items()}}
            row |= {
                x: judged[x] for x in ("success_rate", "overspeed_rate", "settling_over_estimate")
            }
            alone = evaluate(flown, AttitudeEnv(5, spacecraft=LM50), episodes=given.episodes)
            row |= {"lm50_settling_s": alone["settling_time_s"]["mean"]}
            print(json.dumps(row), flush=True)


def _tuned(law, env, agent_steps):
    slews = agent_steps // int(env.default_params.max_steps_in_episode)
    random = np.random.default_rng(0)
    factors = np.exp(random.uniform(-np.log(SPREAD), np.log(SPREAD), (SETS, len(GAINS))))
    factors[0] = 1
    sets = np.minimum(factors * np.array(GAINS), [1.0, 1.0, np.inf, 0.99])
    first = [_time(law, x, env, slews // 2 // SETS, 0) for x in sets]
    best = sets[np.argsort(first)[: SETS // 10]]
    second = [_time(law, x, env, slews // 2 // len(best), 1) for x in best]
    return Gains(*map(float, best[np.argmin(second)]))


def _time(law, gains, env, slews, number):
    """Mean settling time of a fleet's slews, s, in which a failure counts as the whole slew."""
    spacecraft = fleet.draw(np.random.default_rng([0, number]), np.full(slews, env.frameskip))
    params = env.default_params.replace(**spacecraft.parameters())
    controller = jax.tree_util.Partial(law, gains=Gains(*jnp.asarray(gains, float)))
    flown = fly(controller, env, params, jax.random.key(number), slews)
    times = np.where(successes(flown, params), settling_times(flown, env), LM50.duration)
    return np.mean(times)


if __name__ == "__main__":
    main()
