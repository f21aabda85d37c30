"""What adaptation in flight makes of conditions that are not as believed, for docs/adaptation.md.

python benchmarks/adaptation.py --controller phase-plane --episodes 200 "inertia x 2" "mass doubles"

A line for each condition, of the ladder or of those below, in a flight loop that does not adapt
("plain"), in one that does ("adaptive"), and, if asked for, without a loop but with the inertia
that flies in place of the one that is believed ("told"), which is as good as identification can be.
"""

import argparse
import dataclasses
import json
import sys
from pathlib import Path

import jax
import jax.numpy as jnp

from attjax import LM50, AttitudeEnv, errors, flight_loop
from attjax.config.toml import read_spacecraft
from attjax.control.assured import assurance
from attjax.control.classical import CONTROLLERS
from attjax.evaluation.episodes import fly_side_by_side
from attjax.evaluation.ladder import conditions
from attjax.evaluation.robustness import environment, outcome
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
    "the middle torques die": World(actuators=Actuators(dead_levels=(2,), fault_time=MOMENT)),
    "the largest torques die": World(actuators=Actuators(dead_levels=(1,), fault_time=MOMENT)),
}


LOOPS = ("plain", "adaptive", "told")


class Telling(AttitudeEnv):
    """A simulator that says after an observation what inertia moves until the next, (3, 3)."""

    def observe(self, key, state, params):
        """(20,): the observation and the tensor's rows."""
        told = super().observe(key, state, params)
        inertia = state.plant.inertia_at((state.time + 0.5) * self.control_period)
        inertia = jnp.diag(inertia) if inertia.ndim == 1 else inertia
        return jnp.concatenate([told, inertia.reshape(-1).astype(told.dtype)])


def informed(controller, told, context):
    """What a controller does that knows the inertia; told as of :class:`Telling`."""
    context = dataclasses.replace(context, inertia=told[-9:].reshape(3, 3))
    return controller(told[:-9], context)


def parse_arguments(argv=None):
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("conditions", nargs="+")
    parser.add_argument("--controller", default="phase-plane", help="a law's name, or a checkpoint")
    parser.add_argument("--frameskip", type=int, default=5)
    parser.add_argument("--episodes", type=int, default=1000)
    parser.add_argument("--spacecraft", type=Path, help="TOML file (default: LM50)")
    parser.add_argument("--duration", type=float, default=43.75, help="of a slew, s")
    parser.add_argument("--loops", default="plain,adaptive", help=f"of {', '.join(LOOPS)}")
    parser.add_argument("--assured", action="store_true", help="loops under run-time assurance")
    given = parser.parse_args(argv)
    given.loops = given.loops.split(",")
    if set(given.loops) - set(LOOPS):
        parser.error(f"--loops: must be of {', '.join(LOOPS)}, separated by commas")
    return given


@errors.program("adaptation.py")
def main(argv=None) -> int:
    """Fly and print."""
    given = parse_arguments(argv)
    with errors.one_line_errors():
        craft = read_spacecraft(given.spacecraft) if given.spacecraft else LM50
        craft = dataclasses.replace(craft, duration=given.duration)
        ladder = conditions(craft, given.frameskip) | CHANGES
        unknown = [name for name in given.conditions if name not in ladder]
        if unknown:
            raise errors.UserError(f"no condition {unknown[0]!r}; there are {', '.join(ladder)}")
        for name in given.conditions:
            for loop in given.loops:
                row = {"condition": name, "loop": loop, "assured": given.assured}
                print(json.dumps(row | flown(given, craft, ladder[name], loop)), flush=True)
    return 0


def flown(given, craft, world, loop):
    """What comes of the slews in a world, in one of the LOOPS."""
    kind = Telling if loop == "told" else AttitudeEnv
    env = environment(kind(given.frameskip, spacecraft=craft), world)
    law, scores = controller_of(given.controller, adapts=loop == "adaptive")
    if loop == "told":
        others = env.world.actuators, env.world.sensors
        if env.world.uncertainty is None or others != (None, None) or given.assured:
            raise errors.UserError("told: of a wrong inertia alone, and not with --assured")
        pilot = jax.tree_util.Partial(informed, jax.tree_util.Partial(law))
    else:
        under = assurance(env) if given.assured else None
        pilot = flight_loop(law, adapts=loop == "adaptive", assurance=under, scores=scores)
    key = jax.random.key(0)
    (slews,) = fly_side_by_side((pilot,), env, env.default_params, key, given.episodes)
    return outcome(slews, env)


def controller_of(name, adapts):
    """A law by its name, or a checkpoint's policy; and the scores of its actions, or None."""
    if name in CONTROLLERS:
        return CONTROLLERS[name], None
    policy, params = network(Path(name), adapts=adapts)
    return tuple(jax.tree_util.Partial(x, params) for x in (policy.act, policy.scores))


if __name__ == "__main__":
    sys.exit(main())
