"""Recursive identification of a spacecraft's response, in flight.

A Kalman filter beside the estimator's, of what :mod:`attjax.control.response` describes and of the
rate: the response is constant until a χ² test of what is told of the rate says that something has
changed, and is then open to doubt again. So nothing is learned of what is not moved, and nothing is
forgotten. Matrices are arrays of a fixed size; no control flow depends on data.
"""

from typing import NamedTuple

import chex
import jax.numpy as jnp

from attjax.control import square_root
from attjax.control.covariance import Scalar
from attjax.control.linearized import AXES, Model
from attjax.control.response import (
    Identity,
    Period,
    inverted,
    sensitivities,
    symmetric,
)
from attjax.control.square_root import PAIRS, Seen, Spread
from attjax.dynamics import vectors
from attjax.dynamics.fused_loop import together
from attjax.dynamics.numerics import matmul

SURPRISING = 35.4
"""χ² of three numbers that is passed by chance once in 1e7 decisions, three days at 40 Hz."""

SHARE_OF_CHANGE = 1.0
"""Standard deviation of a sudden change, as a share: what dies loses all of it, and no more."""

SHARE_OF_EACH = 0.1
"""The same of each number by itself: ±10 % is what projects assume of an inertia."""

GONE = 0.05
"""Share of an effect below which nothing is left of it."""

MOST_STEP = 0.5
"""A correction of N leaves at least this share of it along every axis, so it stays positive."""

RESOLVED = 1e-3
"""Share of the weakest command's effect that identification resolves: less is of no use."""

LEAST = 1e-30
"""Nothing is divided by zero."""


class Ahead(NamedTuple):
    """What a period makes of the errors before it.

    Attributes:
        spread: at its end.
        by_response: (3, response) the rate's errors by those of the response.
        kicks: (axes, 3) that 1 N m s about each axis has become of the rate.
        commands: (levels, axes) impulses, N m s.
        variances: (levels, axes) of the strengths.
        turned: share that the rate turns by, squared.
    """

    spread: Spread
    by_response: chex.Array
    kicks: chex.Array
    commands: chex.Array
    variances: chex.Array
    turned: chex.Array


def corrected(
    identity: Identity, period: Period, told: list[Scalar], model: Model
) -> tuple[Identity, chex.Array]:
    """What the rate at the end of a period makes of it.

    Args:
        identity: at its beginning.
        period: that has passed.
        told: three rates, as of :func:`attjax.control.measured.innovations`.
        model: of the period, with the identity's inertia.

    Returns:
        The identity after it; and 1 where something must have changed, else 0.
    """
    rows, kicks = together(sensitivities, identity.replace(spread=None), period, model)
    rows, kicks = (jnp.stack([jnp.stack(x) for x in y]) for y in (rows, kicks))
    ahead, offset = _ahead(identity, period, rows, kicks)
    innovation, variances = (jnp.stack(x) for x in list(zip(*told))[1:3])
    seen = Seen(innovation - offset, variances, told[0].is_told)
    surprise = jnp.sum(
        square_root.whitened(_own(ahead, identity), ahead.spread, seen).surprise ** 2
    )
    change = jnp.where(surprise > SURPRISING, 1, 0).astype(kicks.dtype)
    ahead = _opened(identity, ahead, seen, change)
    white = square_root.whitened(_own(ahead, identity), ahead.spread, seen)
    strengths, doubts = _strengths(ahead, white)
    spread, error, response = square_root.updated(ahead.spread, white, seen)
    rate = jnp.stack(period.after) + jnp.stack(period.bias) + offset + error
    added = vectors.components(response[6:].reshape(len(kicks), 3))
    return identity.replace(
        rate=tuple(rate),
        mobility=together(_stepped, identity.mobility, tuple(response[:6])),
        columns=vectors.add(identity.columns, added),
        strengths=vectors.add(identity.strengths, tuple(strengths.reshape(-1))),
        variances=tuple(doubts.reshape(-1)),
        spread=spread,
    ), change


def _ahead(identity, period, rows, kicks):
    """What is known at the end of a period, and the rate there, less the estimator's."""
    before, own, by_response = identity.spread, rows[:, :3], rows[:, 3:]
    before_it = jnp.stack(period.before) + jnp.stack(period.bias)
    offset = jnp.sum(own * (jnp.stack(identity.rate) - before_it), axis=1)
    given = jnp.stack(period.impulses).reshape(-1, len(kicks))
    spread = before._replace(
        cross=matmul(own, before.cross) + matmul(by_response, before.response),
        rate=matmul(matmul(own, before.rate), own.T) + jnp.diag(jnp.stack(period.unexplained)),
    )
    eye = jnp.eye(3, dtype=own.dtype)
    turned = jnp.sum((own - eye) ** 2) + float(jnp.finfo(own.dtype).eps) ** 0.5
    doubts = jnp.stack(identity.variances).reshape(given.shape)
    return Ahead(spread, by_response, kicks, given, doubts, turned), offset


def _sizes(identity):
    """What an error of all of N is, element by element."""
    rows = symmetric(identity.mobility)
    return jnp.stack([jnp.sqrt(rows[i][i] * rows[j][j]) for i, j in PAIRS])


def _own(ahead, identity):
    """Covariance of the rate's errors that are not of the response.

    What is of second order is among them. Sensitivities are those of the mean rate in a period, so
    they are off by about the share that the rate turns by meanwhile; those to N also by the share
    that N may be off by. The root of a number's rounding stands beside that, so that no
    measurement makes a variance vanish against its rounding.
    """
    spread = ahead.spread
    shares = jnp.sum(ahead.commands**2 * ahead.variances, axis=0)
    rate = spread.rate + matmul(ahead.kicks.T * shares, ahead.kicks)
    swung = matmul(ahead.by_response[:, :6], spread.response[:6])
    share = jnp.max(jnp.sum(spread.response[:6] ** 2, axis=1) / _sizes(identity) ** 2)
    most = jnp.sum(spread.cross**2) + jnp.trace(rate)
    more = ahead.turned * most + jnp.minimum(share, 1) * jnp.sum(swung**2)
    return rate + more * jnp.eye(3, dtype=rate.dtype)


def _opened(identity, ahead, seen, change):
    """The same after a sudden change, where there was one.

    If something was commanded in the period, all may have changed in proportion, as by a mass that
    came or went, or the strength of what was commanded. No mass takes all of an effect away, so the
    first is the likelier the more is left of it; where nothing is, it is the strength alone. If
    nothing was commanded, the moments may have changed. Each number may be somewhat off besides,
    and how errors went together is lost.
    """
    spread, axes = ahead.spread, len(ahead.kicks)
    is_on = jnp.where(ahead.commands != 0, change, 0)
    most = jnp.max(is_on)
    columns = jnp.stack([jnp.stack(x) for x in identity.columns])
    response = jnp.concatenate([jnp.stack(identity.mobility), columns.reshape(-1)])
    lengths = jnp.repeat(jnp.sqrt(jnp.sum(columns**2, axis=1)), 3)
    sizes = _sizes(identity)
    alone = jnp.append((change - most) * sizes, jnp.zeros(3 * axes, sizes.dtype))
    each = SHARE_OF_EACH * jnp.append(sizes, lengths)
    deviations = jnp.sum(spread.response**2, axis=1)
    deviations = jnp.maximum(deviations, each**2)  # not more by each of many changes
    deviations = jnp.sqrt(deviations + (SHARE_OF_CHANGE * alone) ** 2)
    strengths = jnp.stack(identity.strengths).reshape(is_on.shape)
    kick = jnp.sum(jnp.sum(ahead.commands * strengths, axis=0)[:, None] * ahead.kicks, axis=0)
    left = 1 + jnp.sum(kick * seen.residual) / jnp.maximum(jnp.sum(kick**2), LEAST)
    is_of_all = (change > 0) & (left > GONE)
    whole = SHARE_OF_CHANGE * most * jnp.clip(left, 0, 1) * response
    shares = whole / jnp.maximum(deviations, LEAST)
    square = jnp.sum(shares**2)
    share = 1 / (1 + jnp.sqrt(1 + square))  # (√(1 + u²) − 1)/u², of the root of D² + w wᵀ
    root = jnp.diag(deviations) + share * whole[:, None] * shares
    opened = Spread(
        rate=spread.rate + matmul(spread.cross, spread.cross.T),
        cross=matmul(ahead.by_response, root),
        response=root,
    )
    return ahead._replace(
        spread=vectors.chosen(is_of_all, opened, spread),
        variances=ahead.variances + SHARE_OF_CHANGE**2 * is_on,
    )


def _strengths(ahead, white):
    """Errors of the strengths, each by itself, and their variances, after the rate was told."""
    kicks = matmul(white.inverse, matmul(white.whitening, ahead.kicks.T))
    weights = ahead.variances * ahead.commands
    certain = weights * ahead.commands * jnp.sum(kicks**2, axis=0)
    error = weights * matmul(kicks.T, white.surprise)
    return error, ahead.variances * jnp.maximum(1 - certain, 0)


def _stepped(mobility, step):
    """N and its correction, of which no more is taken than leaves MOST_STEP of it everywhere.

    The least eigenvalue of N⁻¹ times the correction is at least m − √2 s, with the mean m and the
    standard deviation s of the three (Wolkowicz and Styan 1980).
    """
    inertia = inverted(mobility)
    share = [vectors.times(symmetric(tuple(step)), column) for column in inertia]
    mean = (share[0][0] + share[1][1] + share[2][2]) / 3
    squares = sum(share[i][j] * share[j][i] for i in AXES for j in AXES) / 3
    least = mean - jnp.sqrt(2 * jnp.maximum(squares - mean * mean, 0))
    taken = jnp.minimum(1, MOST_STEP / jnp.maximum(-least, LEAST))
    return tuple(x + taken * s for x, s in zip(mobility, step))
