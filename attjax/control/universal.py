"""The inputs of a policy that flies any spacecraft, in the spacecraft's own units."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from attjax import checks
from attjax.control.own_units import OwnUnits
from attjax.control.scales import at_all_scales
from attjax.control.torque_order import ordered
from attjax.control.triad import times
from attjax.envs import observation as observations
from attjax.envs.context import Context

OWN_SCALES = tuple(4.0**n for n in range(-5, 4))
"""Factors of inputs in a spacecraft's own units: its largest impulse is 1."""

SLEW_SCALES = tuple(2.0**n for n in range(-1, 3))
"""Factors of these over a slew's length: of inputs that are about 1 at the start of any slew."""

PUSH_SCALES = tuple(8.0**n * 4 for n in range(3))
"""Factors of what a constant torque adds to the momentum in a period, in own units."""

PAIRS = (0, 1), (0, 2), (1, 2)
"""Of axes, whose products of inertia the inputs tell."""

CONSTANTS, PRODUCTS, HAND, PUSHES = 24, (3, 4, 5), 13, tuple(range(15, 24))
"""Of the inputs that do not depend on the state: how many, and which change their signs."""


class Universal(NamedTuple):
    """The numbers of the universal inputs, of which JAX, ONNX and C are all made.

    With z = ``of_vector`` q_v + ``of_rate`` ω and p = ``momentum`` ω, the turn to the goal and the
    momentum in the spacecraft's own units (:mod:`attjax.control.own_units`), the inputs are
    tanh(k x) of x = (z/√(1 + |z|), p) for every k of OWN_SCALES and of x over ``lengths`` for every
    k of SLEW_SCALES; then ``directions`` q_v, q_s, ``directions`` ω over the rate limit, and
    ``constants``.

    Which way is forward about an axis is the state's to say, so that no z is negative: where one
    would be, all that is about this axis changes its sign, and the decision is turned back.

    Far from the goal a slew takes as many periods as the root of z, so that z/√(1 + |z|) and p have
    the same ratio in slews of any length; near it the root would be too steep.

    Attributes:
        of_vector, of_rate, momentum: (3, 3).
        directions: (3, 3), dimensionless.
        slowness: (3, 3) directions over the rate limit, s/rad.
        lengths: (3,) of a turn of 1 rad about each axis, in control periods.
        constants: (24,) of the spacecraft, the control rate and a constant torque.
    """

    of_vector: Array
    of_rate: Array
    momentum: Array
    directions: Array
    slowness: Array
    lengths: Array
    constants: Array

    @property
    def factors(self) -> Float[np.ndarray, "scaled columns"]:
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
    products = jnp.stack([units.shape[i, j] / (root[i] * root[j]) for i, j in PAIRS])
    tenths = 10 * units.period
    last = [units.duration / units.period, jnp.log(tenths), units.hand, units.is_crippled]
    parts = (
        0.5 * jnp.log(moments / units.period) - 3,
        products,
        0.5 * jnp.log(units.rate_limit * moments) - 2.25,
        0.25 * jnp.log(units.levels) + 0.5,
        jnp.stack([jnp.asarray(x, moments.dtype) for x in last]),
        *(jnp.tanh(k * units.push) for k in PUSH_SCALES),
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
        (109,) features.
    """
    numbers = Universal.of(ordered(context))
    vector, scalar, rate = _state(observation)
    turn = _turn(numbers, vector, rate)
    sign = jnp.where(turn < 0, -1.0, 1.0)
    own = [abs(turn) / jnp.sqrt(1 + abs(turn)), sign * times(numbers.momentum, rate)]
    scaled = jnp.concatenate([*own, *(x / numbers.lengths for x in own)])
    plain = (
        sign * times(numbers.directions, vector),
        scalar,
        sign * times(numbers.slowness, rate),
        numbers.constants * signs_of_constants(sign),
    )
    return at_all_scales(scaled, numbers.factors, jnp.concatenate(plain))


def backward_axes(
    observation: Float[Array | np.ndarray, "11"], context: Context
) -> Bool[Array, "3"]:
    """(3,) whether the universal inputs call backward what is forward, about each axis in order."""
    vector, _, rate = _state(observation)
    return _turn(Universal.of(ordered(context)), vector, rate) < 0


def _state(observation):
    observation = checks.real("observation", observation, (observations.SIZE,))
    quaternion = observation[observations.QUATERNION]
    return quaternion[:3], quaternion[3:], observation[observations.ANGULAR_VELOCITY]


def _turn(numbers, vector, rate):
    """(3,) z: of the turn to the goal, in own units."""
    return times(numbers.of_vector, vector) + times(numbers.of_rate, rate)


def signs_of_constants(sign: Array) -> Float[Array, "constants"]:
    """What the constants are multiplied by where (3,) signs say which way is forward."""
    unsigned = jnp.ones(CONSTANTS, sign.dtype)
    before, between = unsigned[: PRODUCTS[0]], unsigned[PRODUCTS[-1] + 1 : HAND]
    products = jnp.stack([sign[i] * sign[j] for i, j in PAIRS])
    hand = sign[0] * sign[1] * sign[2]
    pushes = [sign] * len(PUSH_SCALES)
    return jnp.concatenate([before, products, between, hand[None], unsigned[:1], *pushes])
