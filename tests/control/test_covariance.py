"""The covariance of an estimate against the matrix formulas of a Kalman filter, in float64."""

import jax
import numpy as np
import pytest

from attjax.control import covariance
from attjax.control.covariance import ONE, Scalar

EPSILON = float(np.finfo(float).eps)


def full(triangle):
    size = len(triangle)
    return np.array([[covariance.at(triangle, i, j) for j in range(size)] for i in range(size)])


def triangle(matrix):
    return covariance.triangle(len(matrix), lambda i, j: matrix[i, j])


def positive(rng, size):
    root = rng.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


def sparse(rng, size):
    """A matrix and its rows, where zeros are None and some ones ONE."""
    matrix = rng.normal(size=(size, size)) * (rng.random((size, size)) < 0.5)
    np.fill_diagonal(matrix, 1)
    rows = [[{0: None, 1: ONE}.get(x, x) for x in row] for row in matrix]
    return matrix, rows


@pytest.mark.parametrize("size", [6, 12])
def test_in_time_it_is_f_p_ft_plus_q(size):
    rng = np.random.default_rng(size)
    before, (transition, rows) = positive(rng, size), sparse(rng, size)
    noise = np.diag(rng.random(size))
    noise[0, 3] = noise[3, 0] = 0.1
    given = {(i, j): noise[i, j] for i in range(size) for j in range(i, size) if noise[i, j]}
    after = full(covariance.propagated(triangle(before), rows, given))
    np.testing.assert_allclose(after, transition @ before @ transition.T + noise, rtol=1e-12)


def test_measurements_are_kalmans():
    """Several numbers one by one are as all at once by a matrix of gains."""
    rng = np.random.default_rng(1)
    before, variances = positive(rng, 6), rng.random(4) + 0.1
    rows, innovation = rng.normal(size=(4, 6)), rng.normal(size=4)
    spread = rows @ before @ rows.T + np.diag(variances)
    gains = before @ rows.T @ np.linalg.inv(spread)
    measured = [Scalar(list(h), z, r, 1) for h, z, r in zip(rows, innovation, variances)]
    after, correction = covariance.updated(triangle(before), [0] * 6, measured, EPSILON)
    np.testing.assert_allclose(correction, gains @ innovation, rtol=1e-9)
    np.testing.assert_allclose(full(after), before - gains @ rows @ before, rtol=1e-9, atol=1e-12)


def test_what_is_not_told_changes_nothing():
    before = positive(np.random.default_rng(2), 6)
    measured = [Scalar([ONE] + [None] * 5, 3.0, 0.1, 0)]
    after, correction = covariance.updated(triangle(before), [0.0] * 6, measured, EPSILON)
    assert correction == [0.0] * 6
    np.testing.assert_allclose(full(after), before, rtol=1e-14)


def test_single_precision_survives_what_is_told_exactly():
    """A rate with a bias, both unknown to 1e-3, of which the sum is known to 1e-10, and then one.

    The subtraction leaves nothing but rounding, of either sign.
    """
    spread = np.array([[1e-6 + 1e-20, -1e-6], [-1e-6, 1e-6]], np.float32)
    measured = [
        Scalar([ONE, ONE], np.float32(1e-9), np.float32(1e-20), np.float32(1)),
        Scalar([ONE, None], np.float32(1e-4), np.float32(1e-20), np.float32(1)),
    ]
    rounding = float(np.finfo(np.float32).eps)
    start = [np.float32(0)] * 2
    after, correction = jax.jit(lambda p: covariance.updated(p, start, measured, rounding))(
        triangle(spread)
    )
    assert np.all(np.linalg.eigvalsh(full(after)) > -1e-14)
    np.testing.assert_allclose(correction, [1e-4, -1e-4], rtol=1e-2)


def test_rounding_is_not_taken_for_what_is_known():
    """The sum of rate and bias is known exactly, and an angle with it but for its last digit."""
    one, angle = np.float32(1e-6), np.float32(2.5e-8)
    spread = ((np.float32(1e-8), angle, -np.nextafter(angle, one)), (one, -one), (one,))
    measured = [Scalar([None, ONE, ONE], np.float32(1e-9), np.float32(1e-20), np.float32(1))]
    start, rounding = [np.float32(0)] * 3, float(np.finfo(np.float32).eps)
    after, correction = covariance.updated(spread, start, measured, rounding)
    assert abs(correction[0]) < 1e-9
    assert np.all(np.diag(full(after)) > 0)
