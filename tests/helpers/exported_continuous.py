"""Continuous policies to export: quaternion feedback as a network, and untrained ones."""

import ctypes
import functools

import exported
import jax
import numpy as np
from bodies import rotated_inertia

from attjax import AttitudeEnv
from attjax.export.flight_policy import FlightPolicy
from attjax.export.provenance import Origin
from attjax.ppo.networks import Policy
from attjax.runs import build
from attjax.spacecraft import LM50, Spacecraft

WHEELS = Spacecraft(
    name="two wheels",
    inertia=tuple(map(tuple, rotated_inertia().tolist())),
    torque_levels=(0.1, 0.01),
    torque_axes=((0, 1, 0), (0, 0, 1)),
    torque_held=True,
    duration=6.0,
)
STIFFNESS = 6.0 * np.array(LM50.inertia)
DAMPING = 12.0 * np.array(LM50.inertia)


def flying(policy, arrays, spacecraft=LM50, frameskip=5):
    """A policy with these weights and biases of each layer."""
    dense = {
        f"Dense_{n}": {"kernel": np.float32(weights), "bias": np.float32(biases)}
        for n, (weights, biases) in enumerate(arrays)
    }
    env = AttitudeEnv(frameskip, spacecraft=spacecraft, actions="continuous")
    return FlightPolicy(policy, {"policy": {"params": dense}}, env, Origin("no training"))


def arrays_of(flight):
    tree = flight.params["policy"]["params"]
    return [
        (np.array(tree[f"Dense_{n}"]["kernel"]), np.array(tree[f"Dense_{n}"]["bias"]))
        for n in range(len(tree))
    ]


@functools.cache
def feedback():
    """Quaternion feedback as a network: of what each axis is to be turned by, and its negative."""
    wanted = np.zeros((11, 3))
    wanted[:3], wanted[8:] = -np.diag(STIFFNESS), -np.diag(DAMPING)
    means = np.concatenate([np.eye(3), -np.eye(3)])
    spread = np.random.default_rng(1).normal(size=(6, 3))
    layers = [
        (np.concatenate([wanted, -wanted], axis=1), np.zeros(6)),
        (np.concatenate([means, spread], axis=1), [0, 0, 0, -1, -2, -3]),
    ]
    return flying(Policy(hidden_sizes=(6,), actions="continuous"), layers)


@functools.cache
def untrained(features, hidden_sizes, spacecraft=LM50):
    policy = Policy(features, hidden_sizes, actions="continuous")
    tree = jax.eval_shape(lambda: build.initial_parameters(policy)["policy"])["params"]
    rng = np.random.default_rng(5)
    shapes = [tree[f"Dense_{n}"]["kernel"].shape for n in range(len(tree))]
    arrays = [(rng.normal(0, x[0] ** -0.5, x), rng.normal(0, 0.1, x[1])) for x in shapes]
    return flying(policy, arrays, spacecraft, frameskip=10)


def with_a_weight_changed(flight, layer, row, column):
    arrays = arrays_of(flight)
    arrays[layer][0][row, column] *= 1.01
    return flying(flight.policy, arrays, flight.env.spacecraft, flight.env.frameskip)


def c_torques(folder, quaternion, angular_velocity):
    """What attjax_torque of the C export in the folder writes."""
    steer, pointer = exported.library(folder).attjax_torque, ctypes.c_void_p
    torque = np.full((len(quaternion), 3), np.nan, np.float32)
    addresses = [x.ctypes.data for x in (quaternion, angular_velocity, torque)]
    for row in range(len(quaternion)):
        steer(*(pointer(x + size * row) for x, size in zip(addresses, (16, 12, 12))))
    return torque
