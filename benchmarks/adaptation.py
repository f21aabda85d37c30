"""What adaptation in flight makes of conditions that are not as believed, for docs/adaptation.md.

python benchmarks/adaptation.py --controller phase-plane --episodes 200 "inertia x 2" "mass doubles"

A line for each condition, of the ladder or of those below, in a flight loop that does not adapt and
in one that does.
"""

import argparse
import dataclasses
import json
from pathlib import Path

import jax

from attjax import LM50, AttitudeEnv, flight_loop
from attjax.control.assured import assurance
from attjax.control.classical import CONTROLLERS
from attjax.evaluation.episodes import fly_side_by_side
from attjax.evaluation.ladder import conditions
from attjax.evaluation.robustness import outcome
from attjax.runs.flight import network
from attjax.world import Actuators, Uncertainty, Uniform, World

MOMENT = Uniform(1.0, 6.0)
CHANGES = {
    "mass doubles": World(uncertainty=Uncertainty(change_factor=2.0, change_time=MOMENT)),
    "an axis loses half": World(
        actuators=Actuators(faulty_axes=(1,), fault_gain=0.5, fault_time=MOMENT)
    ),
    "delay of up to two periods": World(actuators=Actuators(delay=Uniform(0, 12))),
    "an axis dies": World(actuators=Actuators(faulty_axes=(1,), fault_time=MOMENT)),
}


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("conditions", nargs="+")
    parser.add_argument("--controller", default="phase-plane", help="a law's name, or a checkpoint")
    parser.add_argument("--frameskip", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--duration", type=float, default=43.75, help="of a slew, s")
    parser.add_argument("--adaptive", action="store_true", help="in the loop that adapts alone")
    parser.add_argument("--assured", action="store_true", help="under run-time assurance")
    given = parser.parse_args()
    law, scores = _controller(given.controller)
    craft = dataclasses.replace(LM50, duration=given.duration)
    ladder = conditions(craft, given.frameskip) | CHANGES
    for name in given.conditions:
        env = AttitudeEnv(given.frameskip, spacecraft=craft, world=ladder[name])
        under = assurance(env) if given.assured else None
        for adapts in (True,) if given.adaptive else (False, True):
            loop = flight_loop(law, adapts=adapts, assurance=under, scores=scores)
            key = jax.random.key(0)
            (flown,) = fly_side_by_side((loop,), env, env.default_params, key, given.episodes)
            row = {"condition": name, "adapts": adapts, "assured": given.assured}
            row |= outcome(flown, env)
            print(json.dumps(row), flush=True)


def _controller(name):
    """A law by its name, or a checkpoint's policy; and the scores of its actions, or None."""
    if name in CONTROLLERS:
        return CONTROLLERS[name], None
    policy, params = network(Path(name), adapts=True)
    return tuple(jax.tree_util.Partial(x, params) for x in (policy.act, policy.scores))


if __name__ == "__main__":
    main()
