"""What the networks see of an observation: the inputs, and the numbers that they are made of."""

from typing import NamedTuple, TypeAlias

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Shaped

from attjax import checks
from attjax.control.scales import at_all_scales
from attjax.control.universal import universal_features
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
    return at_all_scales(scaled, numbers.factors, plain)


FEATURES = {
    "state": state_features,
    "multiscale": multiscale_features,
    "universal": universal_features,
}
"""The inputs that have a name; attjax.export.inputs writes them down for C and ONNX."""
