"""What adaptation in flight makes of conditions that are not as believed, for docs/adaptation.md.

python benchmarks/adaptation.py --controller phase-plane --episodes 200 "inertia x 2" "mass doubles"

A line for each condition, of the ladder or of those below, in a flight loop that does not adapt and
in one that does.
"""

import argparse
import json

import jax

from attjax import AttitudeEnv, flight_loop, load_policy
from attjax.control.assured import assurance
from attjax.control.classical import CONTROLLERS
from attjax.evaluation.episodes import fly_side_by_side
from attjax.evaluation.ladder import conditions
from attjax.evaluation.robustness import outcome
from attjax.world import Actuators, Uncertainty, Uniform, World

MOMENT = Uniform(1.0, 6.0)
CHANGES = {
    "mass doubles": World(uncertainty=Uncertainty(change_factor=2.0, change_time=MOMENT)),
    "an axis loses half": World(
        actuators=Actuators(faulty_axes=(1,), fault_gain=0.5, fault_time=MOMENT)
    ),
    "an axis dies": World(actuators=Actuators(faulty_axes=(1,), fault_time=MOMENT)),
}


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("conditions", nargs="+")
    parser.add_argument("--controller", default="phase-plane", help="a law's name, or a checkpoint")
    parser.add_argument("--frameskip", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--assured", action="store_true", help="under run-time assurance")
    given = parser.parse_args()
    known = given.controller in CONTROLLERS
    law = CONTROLLERS[given.controller] if known else load_policy(given.controller)
    ladder = conditions(AttitudeEnv().spacecraft, given.frameskip) | CHANGES
    for name in given.conditions:
        env = AttitudeEnv(given.frameskip, world=ladder[name])
        under = assurance(env) if given.assured else None
        for adapts in (False, True):
            loop, key = flight_loop(law, adapts=adapts, assurance=under), jax.random.key(0)
            (flown,) = fly_side_by_side((loop,), env, env.default_params, key, given.episodes)
            row = {"condition": name, "adapts": adapts, "assured": given.assured}
            row |= outcome(flown, env)
            print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
