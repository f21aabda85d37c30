"""Run-time assurance in C: of discrete actions, those alone that lead beyond no limit."""

from typing import NamedTuple

import jax
import numpy as np

from attjax.control import keep_out
from attjax.control.assured import Assurance
from attjax.export import c_text
from attjax.export.kind import CDecision
from attjax.world import World


class Guard(NamedTuple):
    """An assurance, and what it is for.

    Attributes:
        assurance: of what flies.
        world: that states which plants there may be.
    """

    assurance: Assurance
    world: World

    def admitted(
        self, quaternion: np.ndarray, rate: np.ndarray, rounding: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """What is let through at many states, and whether rounding cannot change it.

        Args:
            quaternion, rate: (states, 4) and (states, 3).
            rounding: relative, of the rate, and of each angle outside of cones, rad.

        Returns:
            (states, actions) and (states,), bool.
        """
        at_all = jax.jit(jax.vmap(Assurance.admissible, (None, 0, 0)))
        admitted = np.asarray(at_all(self.assurance, quaternion, rate))
        is_certain = np.ones(len(rate), bool)
        for change in (-rounding, rounding):
            near = self.assurance.replace(reserve=self.assurance.reserve + change)
            other = np.asarray(at_all(near, quaternion, rate * np.float32(1 + change)))
            is_certain &= np.all(other == admitted, axis=1)
        return admitted, is_certain

    @property
    def told(self) -> str:
        """What it keeps, for people."""
        limits = keep_out.limits(self.assurance.cones)
        world = " ".join(self.world.name.split())
        if self.assurance.is_certain:
            return f"{limits}, for every plant that world {world} states"
        return f"NOTHING IS PROVED of world {world}; {limits}, as well as can be"


def guarded(decision: CDecision, guard: Guard) -> CDecision:
    """A decision in C among the actions alone that are let through."""
    assurance = jax.tree.map(lambda x: np.asarray(x, np.float32), guard.assurance)
    actions, tables = len(assurance.plants.impulse), _of_plants(assurance)
    parts = {"admit_declared": "discrete/admit.h", "admit": "discrete/admit.c"}
    values = {
        "cones": "",
        "kept": "    (void)quaternion;\n",
        "within": "",
        "keep": "    keep_admitted(quaternion, angular_velocity, allowed);\n",
    }
    result = decision._replace(
        kept_rate="kept by the assurance that is told of above",
        parts=parts | dict(decision.parts),
        values=dict(decision.values) | values | _texts(tables) | _numbers(assurance),
        constants=decision.constants + sum(x.size for x in tables.values()),
        stack=decision.stack + 3 + 2 * actions,
        multiply_adds=decision.multiply_adds + 19 + 7 * actions,
        comparisons=decision.comparisons + 1 + 7 * actions,
        other=decision.other + 11 + 21 * actions,
    )
    return result if assurance.cones is None else _with_cones(result, assurance, actions)


def _with_cones(decision, assurance, actions):
    tables = _of_cones(assurance)
    count, phases = len(tables["cone_axes"]), len(tables["edges"]) - 1
    values = {
        "kept": "    const float kept = kept_squared(quaternion, peak);\n",
        # That a cone holds a slew back, in JAX too, is no failure.
        "unless_held": " && slew_error_deg[s] <= GOAL_DEG",
        "within": "\n                      && squared + change[a] <= kept",
        "cone_count": count,
        "edge_count": phases + 1,
        "reserve": c_text.number(assurance.reserve),
        "period_s": c_text.number(assurance.period),
        "most_growth": c_text.number(assurance.plants.most_growth.max()),
    }
    return decision._replace(
        parts={"cones": "discrete/cones.c"} | decision.parts,
        values=decision.values | values | _texts(tables),
        constants=decision.constants + sum(x.size for x in tables.values()),
        stack=decision.stack + 6,
        multiply_adds=decision.multiply_adds + 21 * count + phases + 1,
        comparisons=decision.comparisons + count + 2 * phases + actions,
        other=decision.other + 12 * count + 5 * phases + 4,
    )


def _texts(tables):
    return {name: c_text.table(values) for name, values in tables.items()}


def _of_plants(assurance):
    of_these = assurance.plants
    sizes, worked = (
        np.sqrt(np.sum(x**2, axis=1))
        for x in (of_these.impulse, of_these.coefficients.most_work * of_these.impulse)
    )
    return {
        "axes": of_these.axes,
        "plants_form": of_these.form,
        "least_work": of_these.coefficients.least_work,
        "most_work": of_these.coefficients.most_work,
        "torque_impulse": of_these.impulse,
        "least_share": of_these.share[0],
        "most_share": of_these.share[1],
        "tilted": (of_these.turned + of_these.tilt) * sizes,
        "tilted_work": of_these.turned * worked,
        "other_impulse": of_these.error,
        "growth": of_these.most_growth,
        "turning": of_these.turning,
        "of_rate_error": 2 * assurance.error * of_these.sensitivity,
    }


def _numbers(assurance):
    of_these = assurance.plants
    numbers = {
        "level": assurance.limit,
        "peak_error": of_these.of_error(assurance.error),
        "turned_inverse": of_these.turned * of_these.inverse,
        "square": of_these.square,
        "linear": of_these.linear,
        "feeding": of_these.feeding,
    }
    return {name: c_text.number(x) for name, x in numbers.items()}


def _of_cones(assurance):
    cones, stopping = assurance.cones, assurance.stopping
    return {
        "cone_axes": cones.axes,
        "cone_directions": cones.directions,
        "half_angles": cones.half_angles,
        "edges": np.append(stopping.edges, np.float32(0)),
        "stopping_angles": np.append(stopping.angles, np.float32(0)),
    }
