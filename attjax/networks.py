"""Policy and value networks, and what they see."""

import dataclasses
from collections.abc import Callable

import chex
import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax import checks, dynamics, rigid_body
from attjax import observation as observations
from attjax.context import Context
from attjax.numerics import square_root

SCALES = tuple(4.0**n for n in range(9))
"""Factors of the multi-scale inputs: 1 resolves the slew, 65,536 the last 1e-5 of it."""

FEATURE_PERIOD = 0.05
"""Control period to which the multi-scale inputs scale the attitude, s."""

MASKED_LOGIT = -1e9


@struct.dataclass
class Inputs:
    """All that the networks see of one step.

    Attributes:
        features: (features,) network input.
        allowed: (actions,) bool, the actions that are not masked.
    """

    features: chex.Array
    allowed: chex.Array


class Dense(nn.Module):
    """A layer, in full float32 on every device.

    Its result has a column for each sample. CPUs are slow at the other layout's gradients with
    respect to the kernel, and at sums over a sample's few actions.
    """

    outputs: int
    scale: float

    @nn.compact
    def __call__(self, x, axis):
        """Kernelᵀ x + bias, (outputs, samples), summed over the ``axis`` of x that holds inputs."""
        dtype = jnp.zeros(()).dtype
        initial = nn.initializers.orthogonal(self.scale)
        kernel = self.param("kernel", initial, (x.shape[axis], self.outputs), dtype)
        bias = self.param("bias", nn.initializers.zeros, (self.outputs,), dtype)
        # Without the barrier, the transposition is moved past the product and its gradients.
        rows = jax.lax.optimization_barrier(kernel.T)
        product = jax.lax.dot_general(rows, x, (((1,), (axis,)), ((), ())), precision="highest")
        return product + bias[:, None]


class MLP(nn.Module):
    """Multilayer perceptron with ReLU (Table 3)."""

    hidden_sizes: tuple[int, ...]
    outputs: int
    output_scale: float

    @nn.compact
    def __call__(self, samples):
        """Map (samples, inputs) to (outputs, samples)."""
        x, axis = samples, 1
        for size in self.hidden_sizes:
            x, axis = nn.relu(Dense(size, 2**0.5)(x, axis)), 0
        return Dense(self.outputs, self.output_scale)(x, axis)


@dataclasses.dataclass(frozen=True)
class Policy:
    """A categorical policy and its value function, two networks that share no parameters.

    Attributes:
        features: "state", the observation as it is, "multiscale", or a function of an observation
            (size,) and a context, to (features,).
        hidden_sizes: neurons of each hidden layer.
        num_actions: number of actions.
        rate_margin: the fraction of the rate limit that :func:`rate_mask` keeps; 0: no mask.
    """

    features: str | Callable = "state"
    hidden_sizes: tuple[int, ...] = (400, 300)
    num_actions: int = 19
    rate_margin: float = 0.0

    @property
    def policy_network(self) -> MLP:
        """From features to logits."""
        return MLP(self.hidden_sizes, self.num_actions, 0.01)

    @property
    def value_network(self) -> MLP:
        """From features to V(s)."""
        return MLP(self.hidden_sizes, 1, 1.0)

    def init(self, policy_key, value_key, observation, context) -> dict:
        """Random parameters {"policy": ..., "value": ...} for such an observation (size,)."""
        features = self.encode(observation, context).features[None]
        return {
            "policy": self.policy_network.init(policy_key, features),
            "value": self.value_network.init(value_key, features),
        }

    def encode(self, observation: chex.Array, context: Context | None) -> Inputs:
        """Features and mask of one observation (size,); no parameters are involved."""
        features = FEATURES.get(self.features, self.features)(observation, context)
        allowed = jnp.ones(self.num_actions, bool)
        if self.rate_margin > 0:
            allowed = rate_mask(observation, context, self.rate_margin)
        return Inputs(features, allowed)

    def logits(self, params: dict, inputs: Inputs) -> chex.Array:
        """(actions, samples) of (samples, ...) inputs, MASKED_LOGIT where masked."""
        logits = self.policy_network.apply(params["policy"], inputs.features)
        return jnp.where(inputs.allowed.T, logits, MASKED_LOGIT)

    def log_probabilities(self, params: dict, inputs: Inputs) -> chex.Array:
        """LogSoftmax over the actions (Table 3), (actions, samples), of (samples, ...) inputs."""
        return nn.log_softmax(self.logits(params, inputs), axis=0)

    def value(self, params: dict, features: chex.Array) -> chex.Array:
        """(samples,) V(s) of (samples, features)."""
        return self.value_network.apply(params["value"], features)[0]

    def act(self, params: dict, observation: chex.Array, context: Context) -> chex.Array:
        """The most probable action for one observation, int32."""
        inputs = self.encode(observation, context)
        batch_of_one = jax.tree.map(lambda x: x[None], inputs)
        return jnp.argmax(self.log_probabilities(params, batch_of_one)[:, 0])


def state_features(observation: chex.Array, context: Context | None) -> chex.Array:
    """The observation as it is."""
    del context
    return observation


def multiscale_features(observation: chex.Array, context: Context) -> chex.Array:
    """tanh(k x) of the attitude and of ω for every k of SCALES.

    Near the goal the state is 1e-5 of what it is at the start; each scale resolves its own
    decades. The attitude is the quaternion's vector part times 0.05 s/control period: an
    action changes ω by the same amount at every control rate, but in a longer period ω turns
    the spacecraft farther. In these units, near the goal, the task is the same at all rates.
    q_s, the control period (in 0.1 s) and its logarithm are appended.

    Args:
        observation: (11,) Eq. 11.
        context: of which the control period counts.

    Returns:
        (57,) features.
    """
    control_period = context.control_period
    observation = checks.real("observation", observation, (observations.SIZE,))
    quaternion = observation[observations.QUATERNION]
    attitude = quaternion[:3] * (FEATURE_PERIOD / control_period)
    scaled = jnp.concatenate([attitude, observation[observations.ANGULAR_VELOCITY]])
    plain = jnp.stack([quaternion[3], 10 * control_period, jnp.log(10 * control_period)])
    # One product instead of a concatenation of all the parts: in a batch the features of a
    # spacecraft come to lie side by side, and tanh runs over them several times as fast.
    factors = np.zeros((9, 6 * len(SCALES) + 3), scaled.dtype)
    factors[:6, :-3] = np.kron(np.array(SCALES), np.eye(6))
    factors[6:, -3:] = np.eye(3)
    features = jnp.matmul(jnp.concatenate([scaled, plain]), factors, precision="highest")
    return jnp.where(np.any(factors[:6], axis=0), jnp.tanh(features), features)


FEATURES = {"state": state_features, "multiscale": multiscale_features}


def rate_mask(observation: chex.Array, context: Context, margin: float) -> chex.Array:
    """Which actions keep the spacecraft below the rate limit for good.

    An action is allowed if in the motion that it leads to, its own torque and all coasting after
    it, the rate never passes ``margin`` times the limit, as far as a forecast of first order can
    tell, nor by an upper bound the middle between that and the limit; or if by that bound it
    lowers the peak of a motion that does. So from rest no sequence of allowed actions passes the
    middle (:func:`rate_mask_constants`). Actions without torque are always allowed, so that no
    state is without one.

    Returns:
        (actions,) bool.
    """
    angular_velocity = observation[observations.ANGULAR_VELOCITY]
    form, impulse, own_gain, limit_squared = rate_mask_constants(context, margin)
    gradient = jnp.matmul(form, angular_velocity, precision="highest")
    # The peak's square after the action, less that before: a product for all actions at once.
    gain = 2 * jnp.matmul(impulse, gradient, precision="highest") + own_gain
    peak_squared = jnp.sum(gradient * angular_velocity) + gain
    coasts = jnp.all(context.torque_table == 0, axis=-1)
    return coasts | (peak_squared <= limit_squared) | (gain < 0)


def rate_mask_constants(context: Context, margin: float) -> tuple[chex.Array, ...]:
    """What :func:`rate_mask` needs of a spacecraft, whatever its state.

    The square of the peak rate, P² = ω·Aω, is constant while the spacecraft coasts. A torque that
    would change the rate of a body at rest by Δω in its time d changes P² by 2 Δω·Aω + Δω·AΔω, if
    ω does not turn in the body meanwhile. As it turns by at most √½ P² a second
    (:func:`attjax.rigid_body.peak_rate_form`) and P grows by at most p = √(Δω·AΔω), the change is
    larger by at most √½ d p (P² + ⅔ P p + p²/6). That, for the largest P there may be, is part of
    the own gains; the limits give it back, up to the middle between margin and limit. All this is
    convex in the time, so no bound is passed before the torque ends.

    Returns:
        The (3, 3) form A of the peak rate, the (actions, 3) changes Δω of the rate, rad/s, their
        (actions,) own gains, and the (actions,) squares that are allowed, rad²/s².
    """
    form = rigid_body.peak_rate_form(context.inertia)
    at_rest = jnp.zeros(3, context.inertia.dtype)
    duration = context.torque_duration
    impulse = dynamics.rate_after_impulse(at_rest, context.torque_table, context.inertia, duration)
    squared = jnp.sum(jnp.matmul(impulse, form, precision="highest") * impulse, axis=-1)
    growth = square_root(squared)
    kept, highest = margin * context.rate_limit, (1 + margin) / 2 * context.rate_limit
    turning = rigid_body.MOST_TURNING * duration * growth
    turning = turning * (highest**2 + 2 / 3 * highest * growth + squared / 6)
    allowed = kept**2 + jnp.minimum(turning, highest**2 - kept**2)
    return form, impulse, squared + turning, allowed
