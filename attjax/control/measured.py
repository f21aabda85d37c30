"""What a measurement makes of an estimate, by components, for :mod:`attjax.control.estimator`."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from attjax.control import covariance
from attjax.control.covariance import ONE, Scalar, Triangle, product
from attjax.control.linearized import AXES, Noise, size_of
from attjax.dynamics import vectors
from attjax.dynamics.sensing import Measurement

LEAST = 1e-6
"""Of what a number is rounded relatively to: its square, and this."""

SATURATED = 1 - 1e-6
"""Share of a gyro's limit from which on a sample counts for nothing."""


def correct(estimate: Any, expected: Any, told: Measurement, noise: Noise) -> Any:
    """The estimate after a measurement.

    Args:
        estimate, expected: before it.
        told: by components, whether there is one as 1 or 0.
        noise: of it.
    """
    numbers = innovations(estimate, expected, told, noise)
    rounding = float(jnp.finfo(estimate.quaternion[0].dtype).eps)
    nothing = [jnp.zeros_like(estimate.quaternion[0])] * size_of(estimate)
    spread, error = covariance.updated(estimate.covariance, nothing, numbers, rounding)
    half = vectors.scaled(0.5, tuple(error[:3]))
    turned = vectors.then(estimate.quaternion, (*half, jnp.ones_like(half[0])))
    corrected = estimate.replace(
        quaternion=vectors.unit(turned),
        angular_velocity=vectors.add(estimate.angular_velocity, tuple(error[3:6])),
        covariance=spread,
    )
    if estimate.bias is not None:
        corrected = corrected.replace(bias=vectors.add(estimate.bias, tuple(error[6:9])))
    if estimate.torque is not None:
        corrected = corrected.replace(torque=vectors.add(estimate.torque, tuple(error[-3:])))
    return corrected


def innovations(estimate: Any, expected: Any, told: Measurement, noise: Noise) -> list[Scalar]:
    """What a measurement says that was not expected: three rates, rad/s, and three angles, rad.

    Args:
        estimate, expected, told, noise: as of :func:`correct`.
    """
    return _rates(estimate, expected, told, noise) + _angles(estimate, expected, told, noise)


def _rates(estimate, expected, told, noise):
    rate = estimate.angular_velocity if expected.rate is None else expected.rate
    if estimate.bias is not None:
        rate = vectors.add(rate, estimate.bias)
    variances, numbers = rate_variances(rate, noise), []
    for i in AXES:
        row: list[Any] = [None] * size_of(estimate)
        row[3 + i] = ONE
        if estimate.bias is not None:
            row[6 + i] = ONE
        z, is_told = told.angular_velocity[i], told.has_angular_velocity
        if noise.rate is not None and noise.rate.limit is not None:
            is_told = is_told * (jnp.abs(z) < SATURATED * noise.rate.limit)
        numbers.append(Scalar(row, z - rate[i], variances[i], is_told))
    return numbers


def rate_variances(rate: vectors.Vector, noise: Noise) -> list[Any]:
    """Of a gyro's sample about each axis at a rate, rad²/s²."""
    squared = vectors.dot(rate, rate)
    rounding = noise.rounding * (squared + LEAST)
    if noise.rate is None:
        return [rounding] * 3
    return [noise.rate.sample**2 + rounding] * 3


def _angles(estimate, expected, told, noise):
    """The angle between what was seen and what should have been, about the star tracker's axes."""
    seen_from, turned = estimate.quaternion, None
    if expected.turn is not None:
        seen_from = vectors.then(seen_from, vectors.conjugate(expected.turn))
        turned = vectors.attitude_matrix(expected.turn)
    error = vectors.then(vectors.conjugate(seen_from), told.quaternion)
    angle = vectors.scaled(jnp.where(error[3] < 0, -2, 2), error[:3])
    axes, numbers = frame(noise), []
    for axis, variance in zip(axes, angle_variances(told.quaternion, noise)):
        row = list(axis)
        slow = [None] * 3
        if turned is not None:
            row = [product(axis, turned[k]) for k in AXES]
            slow = [-noise.turning * expected.age * x for x in row]
            variance = variance + _turned_since(row, estimate, expected, noise)
        row = row + slow + [None] * (size_of(estimate) - 6)
        numbers.append(Scalar(row, product(axis, angle), variance, told.has_quaternion))
    return numbers


def _turned_since(row, estimate, expected, noise):
    """Variance of the attitude that the rate's errors since a sample have added, so far as they are
    other ones at each decision: what is the same all the time is in the row.
    """
    lag = noise.turning**2 * expected.age * noise.period
    spread = [covariance.at(estimate.covariance, 3 + i, 3 + i) for i in AXES]
    return lag * product([x * x for x in row], spread)


def frame(noise: Noise) -> list[list[Any]]:
    """Three axes of the star tracker, the last its boresight; zeros are None, and ones ONE."""
    if noise.attitude is None:
        axes = np.eye(3)
    else:
        boresight = np.array(noise.attitude.boresight) / np.linalg.norm(noise.attitude.boresight)
        far = np.eye(3)[np.argmin(np.abs(boresight))]
        across = np.cross(boresight, far) / np.linalg.norm(np.cross(boresight, far))
        axes = np.array([across, np.cross(boresight, across), boresight])
    shown = {0.0: None, 1.0: ONE}
    return [[shown.get(x, x) for x in axis.tolist()] for axis in axes]


def angle_variances(quaternion: vectors.Quaternion, noise: Noise) -> list[Any]:
    """Of a star tracker's sample of an attitude about the axes of :func:`frame`, rad²."""
    rounding = noise.rounding * (vectors.dot(quaternion[:3], quaternion[:3]) + LEAST)
    if noise.attitude is None:
        return [rounding] * 3
    across, about = noise.attitude.across**2, noise.attitude.about**2
    return [x + rounding for x in (across, across, about)]


def first_covariance(estimate: Any, noise: Noise) -> Triangle:
    """The covariance of an estimate that is what was measured first."""
    size, rates = size_of(estimate), rate_variances(estimate.angular_velocity, noise)
    axes, angles = frame(noise), angle_variances(estimate.quaternion, noise)
    zero = jnp.zeros_like(estimate.quaternion[0])
    has_bias, bias = estimate.bias is not None, [zero] * 3
    if noise.rate is not None and noise.rate.bias is not None:
        turning = noise.rate.share_of(estimate.angular_velocity, (0.0, 0.0, 0.0))
        bias = [noise.rate.bias**2 + x for x in turning]

    def element(i, j):
        if j < 3:
            terms = [
                variance * axis[i] * axis[j]
                for axis, variance in zip(axes, angles)
                if axis[i] is not None and axis[j] is not None
            ]
            return sum(terms, zero)
        if i == j and i < 6:
            return rates[i - 3] + bias[i - 3]
        if has_bias and i >= 3 and j < 9 and j - i in (0, 3):
            return bias[i % 3] if i == j else -bias[i % 3]
        return noise.torque if i == j else zero

    return covariance.triangle(size, element)
