"""A trained policy as flight software needs it: one spacecraft, one control rate, plain arrays."""

import dataclasses
import functools
import hashlib

import chex
import jax.numpy as jnp
import numpy as np

from attjax.control import assurance
from attjax.envs import observation as observations
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.context import Context
from attjax.export import provenance
from attjax.export.assured import Guard
from attjax.export.continuous import CONTINUOUS
from attjax.export.discrete import DISCRETE
from attjax.export.kind import Kind
from attjax.export.provenance import Origin
from attjax.ppo.networks import Policy

KINDS = {"discrete": DISCRETE, "continuous": CONTINUOUS}


@dataclasses.dataclass(frozen=True)
class Layer:
    """Weights (inputs, outputs) and biases (outputs,), float32."""

    weights: np.ndarray
    biases: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class FlightPolicy:
    """What an export is made of.

    Attributes:
        policy: the networks, and what they see.
        params: {"policy": ...}, their parameters.
        env: the simulator of the spacecraft, with its control rate.
        origin: where the parameters come from, and what they were trained for.
        guard: an assurance that lets through some of the actions; None: there is none.

    Raises:
        ValueError: a parameter is not finite in float32, it is not one action alone that has no
            torque, the simulator has another kind of actions than the policy, its torques are not
            in a universal policy's order, or other rules than Eq. 9 and 11, which a spacecraft
            obeys.
    """

    policy: Policy
    params: dict
    env: AttitudeEnv
    origin: Origin
    guard: Guard | None = None

    def __post_init__(self):
        if self.env.kinematic_factor != 0.5:
            factor = f"{self.env.kinematic_factor:g}"
            raise ValueError(f"kinematic_factor is {factor}; a spacecraft moves by Eq. 9, with 0.5")
        if not self.env.observes_quaternion_rate:
            raise ValueError("observes_quaternion_rate is False; flight software is told of Eq. 11")
        if self.env.actions != self.policy.actions:
            raise ValueError(
                f"the simulator has {self.env.actions} actions, the policy {self.policy.actions}"
            )
        chosen = self.policy.command(np.arange(self.policy.num_actions), self.context)
        if self.policy.actions == "discrete" and np.any(
            chosen != np.arange(len(self.torque_table))
        ):
            raise ValueError(
                f"{self.env.spacecraft} has torques in another order than the policy; export it "
                f"for attjax.control.torque_order.in_order of it"
            )
        arrays = [x for layer in _layers(self.params) for x in (layer.weights, layer.biases)]
        if not all(np.all(np.isfinite(x)) for x in arrays):
            raise ValueError("the policy has parameters that are not finite")
        if np.sum(assurance.coasts(self.torque_table)) != 1:
            raise ValueError("the torque table must have one action without torque")

    @property
    def kind(self) -> Kind:
        """Of its actions."""
        return KINDS[self.policy.actions]

    @functools.cached_property
    def context(self) -> Context:
        """The spacecraft as the policy knows it, in float32."""
        return self.env.context(self.env.default_params)

    def act(self, observation: chex.Array, context: Context) -> chex.Array:
        """The action for an observation (size,), of those that the assurance lets through."""
        if self.guard is None:
            return self.policy.act(self.params, observation, context)
        scores = self.policy.scores(self.params, observation, context)
        return self.guard.assurance.chosen(observation, scores)

    def act_in_float32(self, observation: chex.Array, context: Context) -> chex.Array:
        """The action for an observation (11,) of any type; the context is its own, float32."""
        del context
        single = observation.astype(jnp.float32)
        state = single[observations.QUATERNION], single[observations.ANGULAR_VELOCITY]
        return self.act(observations.observe(*state), self.context)

    @property
    def control_period(self) -> np.float32:
        """Time between two decisions, s."""
        return np.float32(self.context.control_period)

    @property
    def torque_table(self) -> np.ndarray:
        """(actions, 3) torques, N m, float32, without negative zeros."""
        return np.asarray(self.context.torque_table, np.float32) + np.float32(0)

    @property
    def layers(self) -> list[Layer]:
        """The policy network's layers, from the features to what the decision is made of."""
        *hidden, last = _layers(self.params)
        outputs = slice(self.kind.outputs)
        return [*hidden, Layer(last.weights[:, outputs], last.biases[outputs])]

    @property
    def facts(self) -> dict[str, str]:
        """What an exported file says of itself: :func:`attjax.export.provenance.facts`."""
        parameters = parameter_hash(self.params)
        craft = self.env.spacecraft
        told = provenance.facts(self.origin, self.env.frameskip, craft, parameters)
        return told if self.guard is None else told | {"assured": self.guard.told}


def _layers(params):
    tree = params["policy"]["params"]
    dense = [tree[f"Dense_{index}"] for index in range(len(tree))]
    with np.errstate(over="ignore"):  # of float64
        return [Layer(*(np.asarray(d[k], np.float32) for k in ("kernel", "bias"))) for d in dense]


def parameter_hash(params: dict) -> str:
    """The name of a policy's parameters {"policy": ...}: 16 hexadecimal digits of a SHA-256.

    It is that of the float32 numbers, little-endian, of the layers in order: the weights
    (inputs, outputs), row by row, then the biases. So it is the same on every platform.
    """
    digest = hashlib.sha256()
    for layer in _layers(params):
        for values in (layer.weights, layer.biases):
            digest.update(values.astype("<f4").tobytes())
    return digest.hexdigest()[:16]


def decide(
    flight: FlightPolicy, quaternion: chex.Array, angular_velocity: chex.Array
) -> tuple[chex.Array, chex.Array] | chex.Array:
    """What the policy does in one state; pure JAX.

    Args:
        flight: the policy.
        quaternion: (4,) unit error quaternion, scalar last.
        angular_velocity: (3,) body frame, rad/s.

    Returns:
        The action, an int32 scalar, and the logits (actions,); or, of continuous actions, the
        torque (3,), body frame, N m.
    """
    return flight.kind.decide(flight, quaternion, angular_velocity)
