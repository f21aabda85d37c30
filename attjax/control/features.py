"""What the networks see of an observation: the inputs, and the numbers that they are made of."""

from typing import NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Shaped

from attjax import checks
from attjax.control.own_units import OwnUnits, ordered
from attjax.envs import observation as observations
from attjax.envs.context import Context

SCALES = tuple(4.0**n for n in range(9))
"""Factors of the multi-scale inputs: 1 resolves the slew, 65,536 the last 1e-5 of it."""

FEATURE_PERIOD = 0.05
"""Control period to which the multi-scale inputs scale the attitude, s."""


Scalar: TypeAlias = Float[Array, ""] | np.floating | float


class Multiscale(NamedTuple):
    """The numbers of the multi-scale inputs, of which JAX, ONNX and C are all made.

    The inputs are tanh(x F), then q_s and the inputs that tell the period, where x = (a q₁, a q₂,
    a q₃, ω). Each number is worked out where it is asked for, with JAX in a policy that is being
    compiled and else at once.

    Attributes:
        control_period: time between two actions, s.

    Example:
        >>> Multiscale(0.025).attitude_factor, Multiscale(0.025).factors.shape
        (2.0, (6, 54))
    """

    control_period: Scalar

    @property
    def attitude_factor(self) -> Scalar:
        """a: what the vector part of the quaternion is multiplied by."""
        return FEATURE_PERIOD / self.control_period

    @property
    def scales(self) -> Float[np.ndarray, "scales"]:
        """(scales,) factors of each component of x."""
        return np.array(SCALES)

    @property
    def factors(self) -> Float[np.ndarray, "6 columns"]:
        """F: (6, 6 * scales), all of x times the first scale, then times the second, ..."""
        return np.kron(self.scales, np.eye(6))

    @property
    def period(self) -> tuple[Scalar, ...]:
        """The inputs that do not depend on the state: the period in 0.1 s, and its logarithm."""
        return 10 * self.control_period, jnp.log(10 * self.control_period)


def state_features(
    observation: Shaped[Array | np.ndarray, "size"], context: Context | None
) -> Shaped[Array | np.ndarray, "size"]:
    """The observation as it is."""
    del context
    return observation


def multiscale_features(
    observation: Float[Array | np.ndarray, "11"], context: Context
) -> Float[Array, "features"]:
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
    numbers = Multiscale(context.control_period)
    observation = checks.real("observation", observation, (observations.SIZE,))
    quaternion = observation[observations.QUATERNION]
    attitude = quaternion[:3] * numbers.attitude_factor
    scaled = jnp.concatenate([attitude, observation[observations.ANGULAR_VELOCITY]])
    plain = jnp.stack([quaternion[3], *numbers.period])
    return _at_all_scales(scaled, numbers.factors, plain)


def _at_all_scales(scaled, factors, plain):
    """tanh(scaled factors), then what is plain.

    One product instead of a concatenation of all the parts: in a batch the features of a
    spacecraft come to lie side by side, and tanh runs over them several times as fast.
    """
    factors = np.pad(factors, (0, plain.size)).astype(scaled.dtype)
    factors[scaled.size :, -plain.size :] = np.eye(plain.size)
    features = jnp.matmul(jnp.concatenate([scaled, plain]), factors, precision="highest")
    return jnp.where(np.any(factors[: scaled.size], axis=0), jnp.tanh(features), features)


OWN_SCALES = tuple(4.0**n for n in range(-5, 4))
"""Factors of inputs in a spacecraft's own units: its largest impulse is 1."""

SLEW_SCALES = tuple(2.0**n for n in range(-1, 3))
"""Factors of these over a slew's length: of inputs that are about 1 at the start of any slew."""


class Universal(NamedTuple):
    """The numbers of the universal inputs, of which JAX, ONNX and C are all made.

    With z = ``of_vector`` q_v + ``of_rate`` ω and p = ``momentum`` ω, the turn to the goal and the
    momentum in the spacecraft's own units (:mod:`attjax.control.own_units`), the inputs are
    tanh(k x) of x = (z/√(1 + |z|), p) for every k of OWN_SCALES and of x over ``lengths`` for every
    k of SLEW_SCALES; then ``directions`` q_v, q_s, ``directions`` ω over the rate limit, and
    ``constants``.

    Far from the goal a slew takes as many periods as the root of z, so that z/√(1 + |z|) and p have
    the same ratio in slews of any length; near it the root would be too steep.

    Attributes:
        of_vector, of_rate, momentum: (3, 3).
        directions: (3, 3), dimensionless.
        slowness: (3, 3) directions over the rate limit, s/rad.
        lengths: (3,) of a turn of 1 rad about each axis, in control periods.
        constants: (13,) of the spacecraft and the control rate.
    """

    of_vector: Array
    of_rate: Array
    momentum: Array
    directions: Array
    slowness: Array
    lengths: Array
    constants: Array

    @property
    def factors(self) -> Float[np.ndarray, "12 columns"]:
        """(12, 6 * scales) of x and of x over the lengths; the first scale, then the second, ..."""
        own, slew = (np.kron(scales, np.eye(6)) for scales in (OWN_SCALES, SLEW_SCALES))
        return np.block([[own, np.zeros_like(slew)], [np.zeros_like(own), slew]])

    @classmethod
    def of(cls, context: Context) -> "Universal":
        """The numbers of a spacecraft at a control rate."""
        units = OwnUnits.of(context)
        return cls(
            of_vector=2 / units.period * units.momentum,
            of_rate=units.duration / (2 * units.period) * units.momentum,
            momentum=units.momentum,
            directions=units.directions,
            slowness=units.directions / units.rate_limit,
            lengths=jnp.sqrt(jnp.diagonal(units.shape) / units.period),
            constants=_constants(units),
        )


def _constants(units):
    """What kind of spacecraft it is, in numbers of about 1."""
    moments = jnp.diagonal(units.shape)
    root = jnp.sqrt(moments)
    first, second = np.array([0, 0, 1]), np.array([1, 2, 2])
    products = units.shape[first, second] / (root[first] * root[second])
    tenths = 10 * units.period
    last = jnp.stack([units.duration / units.period, jnp.log(tenths)])
    parts = (
        0.5 * jnp.log(moments / units.period) - 3,
        products,
        0.5 * jnp.log(units.rate_limit * moments) - 2.25,
        0.25 * jnp.log(units.levels) + 0.5,
        last,
    )
    return jnp.concatenate(parts)


def universal_features(
    observation: Float[Array | np.ndarray, "11"], context: Context
) -> Float[Array, "features"]:
    """The attitude and the rate in the spacecraft's own units, and what kind of spacecraft it is.

    In these units the end of a slew is the same for every spacecraft with three torque axes and at
    every control rate, whether torques are pulses or held.

    Args:
        observation: (11,) Eq. 11.
        context: of the spacecraft.

    Returns:
        (98,) features.
    """
    numbers = Universal.of(ordered(context))
    observation = checks.real("observation", observation, (observations.SIZE,))
    quaternion = observation[observations.QUATERNION]
    vector, rate = quaternion[:3], observation[observations.ANGULAR_VELOCITY]
    turn = _times(numbers.of_vector, vector) + _times(numbers.of_rate, rate)
    own = [turn / jnp.sqrt(1 + abs(turn)), _times(numbers.momentum, rate)]
    scaled = jnp.concatenate([*own, *(x / numbers.lengths for x in own)])
    plain = (
        _times(numbers.directions, vector),
        quaternion[3:],
        _times(numbers.slowness, rate),
        numbers.constants,
    )
    return _at_all_scales(scaled, numbers.factors, jnp.concatenate(plain))


def _times(matrix, vector):
    """Their product, by components: of a batch, jaxlib 0.10.2 sums rows beyond 2¹⁵ numbers wrongly
    on a CPU (jax-ml/jax issue 39103).
    """
    return jnp.stack(
        [row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2] for row in matrix]
    )


FEATURES = {
    "state": state_features,
    "multiscale": multiscale_features,
    "universal": universal_features,
}
"""The inputs that have a name; attjax.export.inputs writes them down for C and ONNX."""
