"""A trained policy as flight software needs it: one spacecraft, one control rate, plain arrays."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np

from attjax import evaluation, networks
from attjax import observation as observations
from attjax import quaternion as quaternions
from attjax.context import Context
from attjax.env import AttitudeEnv
from attjax.networks import Policy

TIE = 1e-4
"""Actions whose logits differ by less than this share of the logits' range are tied."""

MASK_ROUNDING = 1e-6
"""Relative change of ω that must not change which actions are masked in a clear decision."""


@dataclasses.dataclass(frozen=True)
class Layer:
    """Weights (inputs, outputs) and biases (outputs,), float32."""

    weights: np.ndarray
    biases: np.ndarray


@dataclasses.dataclass(frozen=True)
class RateMask:
    """:func:`attjax.networks.rate_mask` as constants.

    With g = A ω, the square of the peak rate after action a is at most ω·g + gain_a, where
    gain_a = 2 Δω_a·g + own_gain_a. An action is allowed if that is at most ``limit_squared``,
    or if gain_a < 0, or if it has no torque.

    Attributes:
        form: (3, 3) A of :func:`attjax.rigid_body.peak_rate_form`, dimensionless.
        impulse: (actions, 3) Δω_a, change of the rate by each action, rad/s.
        own_gain: (actions,) Δω_a·A Δω_a and a bound of what is not of first order, rad²/s².
        limit_squared: (actions,) rad²/s².
    """

    form: np.ndarray
    impulse: np.ndarray
    own_gain: np.ndarray
    limit_squared: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class FlightPolicy:
    """What an export is made of.

    Attributes:
        policy: the networks, and what they see.
        params: {"policy": ...}, their parameters.
        env: the simulator of the spacecraft, with its control rate.
        origin: where the parameters come from, one line for the user.

    Raises:
        ValueError: a parameter is not finite, or it is not one action alone that has no torque.
    """

    policy: Policy
    params: dict
    env: AttitudeEnv
    origin: str

    def __post_init__(self):
        if not all(np.all(np.isfinite(x)) for x in jax.tree.leaves(self.params)):
            raise ValueError("the policy has parameters that are not finite")
        if np.sum(np.all(self.torque_table == 0, axis=1)) != 1:
            raise ValueError("the torque table must have one action without torque")

    @functools.cached_property
    def context(self) -> Context:
        """The spacecraft as the policy knows it, in float32."""
        return self.env.context(self.env.default_params)

    def act_in_float32(self, observation, context: Context):
        """The action for an observation (11,) of any type; the context is its own, float32."""
        del context
        single = observation.astype(jnp.float32)
        state = single[observations.QUATERNION], single[observations.ANGULAR_VELOCITY]
        return decide(self, *state)[0]

    @property
    def control_period(self) -> np.float32:
        """Time between two decisions, s."""
        return np.float32(self.context.control_period)

    @property
    def torque_table(self) -> np.ndarray:
        """(actions, 3) torques, N m, float32."""
        return np.asarray(self.context.torque_table, np.float32)

    @property
    def no_torque(self) -> int:
        """The action without torque."""
        return int(np.flatnonzero(np.all(self.torque_table == 0, axis=1))[0])

    @property
    def layers(self) -> list[Layer]:
        """The policy network's layers, from the features to the logits."""
        tree = self.params["policy"]["params"]
        dense = [tree[f"Dense_{index}"] for index in range(len(tree))]
        return [Layer(*(np.asarray(d[k], np.float32) for k in ("kernel", "bias"))) for d in dense]

    @property
    def rate_mask(self) -> RateMask | None:
        """The mask, None if the policy has none."""
        if self.policy.rate_margin == 0:
            return None
        constants = networks.rate_mask_constants(self.context, self.policy.rate_margin)
        return RateMask(*(np.asarray(x, np.float32) for x in constants))


def decide(flight: FlightPolicy, quaternion, angular_velocity):
    """The action, an int32 scalar, and the logits (actions,) for one state; pure JAX.

    Args:
        flight: the policy.
        quaternion: (4,) unit error quaternion, scalar last.
        angular_velocity: (3,) body frame, rad/s.
    """
    observation = observations.observe(quaternion, angular_velocity)
    inputs = flight.policy.encode(observation, flight.context)
    batch_of_one = jax.tree.map(lambda x: x[None], inputs)
    logits = flight.policy.logits(flight.params, batch_of_one)[:, 0]
    action = flight.policy.act(flight.params, observation, flight.context)
    return action.astype(jnp.int32), logits


@dataclasses.dataclass(frozen=True)
class Decisions:
    """States, and what the policy does there.

    Attributes:
        quaternion, angular_velocity: (states, 4) and (states, 3).
        action: (states,) int32.
        logits: (states, actions), MASKED_LOGIT where masked.
        clear: (states,) bool, whether rounding cannot decide: the two best actions are no tie,
            and no action is within rounding of being masked or not.
    """

    quaternion: np.ndarray
    angular_velocity: np.ndarray
    action: np.ndarray
    logits: np.ndarray
    clear: np.ndarray


def decisions(flight: FlightPolicy, quaternion, angular_velocity) -> Decisions:
    """What the policy does at the states (states, 4) and (states, 3)."""
    quaternion, angular_velocity = (
        np.asarray(x, np.float32) for x in (quaternion, angular_velocity)
    )
    action, logits = map(np.asarray, _decide_all(flight, quaternion, angular_velocity))
    nearby = [
        np.asarray(_decide_all(flight, quaternion, angular_velocity * np.float32(1 + change))[1])
        for change in (-MASK_ROUNDING, MASK_ROUNDING)
    ]
    masked = logits == networks.MASKED_LOGIT
    same_mask = [np.all((x == networks.MASKED_LOGIT) == masked, axis=1) for x in nearby]
    clear = _not_tied(np.where(masked, np.nan, logits)) & same_mask[0] & same_mask[1]
    return Decisions(quaternion, angular_velocity, action, logits, clear)


@functools.partial(jax.jit, static_argnums=0)
def _decide_all(flight, quaternion, angular_velocity):
    return jax.vmap(functools.partial(decide, flight))(quaternion, angular_velocity)


def _not_tied(logits):
    """Whether the best logit leads the second by TIE of their range; NaN where masked."""
    span = np.nanmax(logits, axis=1) - np.nanmin(logits, axis=1)
    second, best = np.sort(np.nan_to_num(logits, nan=-np.inf), axis=1)[:, -2:].T
    return best - second > TIE * span


def flown_decisions(flight: FlightPolicy, seed: int, slews: int, states_per_slew: int) -> Decisions:
    """Decisions at states evenly spaced in time along random slews that the policy flies."""
    params = flight.env.default_params
    _, start = evaluation.random_slews(flight.env, params, jax.random.key(seed), slews)
    act = jax.tree_util.Partial(flight.policy.act, flight.params)
    steps = int(params.max_steps_in_episode)
    history = evaluation.record(act, flight.env, params, start, steps)
    chosen = np.linspace(0, steps - 1, states_per_slew).astype(int)
    states = (np.asarray(x)[chosen] for x in (history.quaternion, history.angular_velocity))
    return decisions(flight, *(x.reshape(-1, x.shape[-1]) for x in states))


@dataclasses.dataclass(frozen=True)
class Flown:
    """Slews that were flown: start (slews, 4), terminal φ and ‖ω‖ (slews,), float64."""

    quaternion: np.ndarray
    error_deg: np.ndarray
    rate: np.ndarray


def fly_table_5(flight: FlightPolicy) -> Flown:
    """Fly the slews of evaluation.TABLE_5.

    The spacecraft is simulated in float64, with the float32 constants that the policy knows, and
    the policy is told its state in float32. That is what the C test program does, so both see
    the same states for as long as they decide alike.
    """
    act = jax.tree_util.Partial(flight.act_in_float32)
    with jax.enable_x64(True):
        params = flight.env.default_params.replace(
            inertia=jnp.asarray(flight.context.inertia, float),
            torque_table=jnp.asarray(flight.torque_table, float),
        )
        steps, start = int(params.max_steps_in_episode), evaluation.table_5_slews()
        history = evaluation.record(act, flight.env, params, start, steps)
        angle = jnp.rad2deg(jax.vmap(quaternions.error_angle)(history.quaternion[-1]))
        rate = jnp.linalg.norm(history.angular_velocity[-1], axis=-1)
        return Flown(*map(np.asarray, (start.quaternion, angle, rate)))
