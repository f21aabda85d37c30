"""Continuous actions: torques about the three axes of the body frame, the mean of a Gaussian."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from attjax.envs import observation as observations
from attjax.envs import torques
from attjax.export import c_text
from attjax.export.kind import NOTHING_KEEPS, CDecision, Kind, States, decide_all

ROUNDINGS = 8
"""How many times JAX's own error in float32 an export's torque may differ from JAX's.

Every format rounds each operation alike but adds up a layer's inputs in its own order: their errors
are of one size, and differ.
"""


@dataclasses.dataclass(frozen=True)
class Torques(States):
    """States, and what the policy does there.

    Attributes:
        torque: (states, 3) N m, float32.
        tolerance: how far rounding may move a torque, N m: ROUNDINGS times the largest difference
            at these states between JAX in float32 and in float64, or half a unit in the last place
            of the largest torque where that is more.
    """

    torque: np.ndarray
    tolerance: float

    @property
    def comparable(self) -> np.ndarray:
        """Where the torque is finite: not where the simulation did not converge."""
        return np.all(np.isfinite(self.torque), axis=1)

    @property
    def c_values(self) -> dict[str, object]:
        """What the test vectors are."""
        return {
            "compared": "and the torques there, N m",
            "decision": "float torque[3]",
            "tolerance": c_text.number(self.tolerance),
            "roundings": ROUNDINGS,
        }

    def c_decision(self, state: int) -> str:
        """The torque."""
        return c_text.row(self.torque[state])


def _decide(flight, quaternion, angular_velocity):
    """(3,) torque, N m."""
    observation = observations.observe(quaternion, angular_velocity)
    action = flight.policy.act(flight.params, observation, flight.context)
    return torques.applied_torque(action, flight.env.default_params)


def _torques(flight, quaternion, angular_velocity):
    torque = np.asarray(decide_all(flight, quaternion, angular_velocity))
    error = np.nanmax(np.abs(torque - _in_float64(flight, quaternion, angular_velocity)))
    unit = np.finfo(np.float32).eps / 2 * np.max(_largest_torques(flight))
    return Torques(quaternion, angular_velocity, torque, float(ROUNDINGS * max(error, unit)))


def _in_float64(flight, *state):
    """(states, 3) torques by the same parameters and states, all worked out in float64."""
    with jax.enable_x64(True):
        params = jax.tree.map(lambda x: jnp.asarray(x, float), flight.params)
        double = dataclasses.replace(flight, params=params)
        return np.asarray(decide_all(double, *(np.asarray(x, float) for x in state)))


def _largest_torques(flight):
    """(3,) float32."""
    return np.asarray(torques.largest_torques(flight.torque_table), np.float32)


_C_NAMES = {
    "function": "attjax_torque",
    "given": "that it writes",
    "torque_declared": "float torque[3];",
    "torque_decided": "attjax_torque(single, single + 4, torque);",
    "turns": "turns(x)",
    "sink": "float torque[3];\n    volatile float sink = 0.0f;",
    "timed": (
        "attjax_torque(vectors[v].quaternion, vectors[v].angular_velocity, torque);\n"
        "            sink = torque[0];"
    ),
}


def _c(flight):
    largest = _largest_torques(flight)
    return CDecision(
        parts={
            "interface": "continuous/interface.h",
            "torques": "continuous/torques.c",
            "network": "continuous/network.c",
            "decide": "continuous/decide.c",
        },
        test_parts={"compare": "continuous/compare.c"},
        names=_C_NAMES,
        values={
            "title": "the torque to apply next",
            "largest": ", ".join(map(str, largest)),
            "largest_torque": c_text.row(largest),
            "unless_held": "",
            "outputs": "outputs",
        },
        kept_rate=NOTHING_KEEPS,
        constants=3,
        stack=3,  # outputs
        tanh=3,
        comparisons=3,
        other=3,
    )


def _onnx(graph, flight, outputs):
    """The largest torques times tanh of the outputs."""
    largest = graph.constant("largest_torque", _largest_torques(flight))
    fraction = graph.add("Tanh", [outputs], "fraction")
    graph.add("Mul", [fraction, largest], "torque")
    graph.result("torque", np.float32, 3)


def _results(flight):
    del flight
    return {"torque": "float32 (3,), about the axes of the body frame, N m"}


CONTINUOUS = Kind(3, _decide, _torques, _c, _onnx, _results)
