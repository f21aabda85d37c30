"""How a spacecraft's rate answers to what is commanded, as far as that is known.

The mobility N = I⁻¹, and a column B_a for each torque axis, by which an impulse u about it changes
the rate, B_a u. In a control period without other torques

    Δω = Σ B_a u_a − ∫ N (ω × N⁻¹ ω) dt,

which is linear in B, and does not change if N is multiplied by a number: sensors that tell of
motion alone cannot say how large inertia and torques are, only how large in proportion. What is
known of each beforehand decides that (:mod:`attjax.envs.doubt`), by the correlation of B = N G
with N. Each level of each axis has a strength beside that, its share of what it is asked to give.
"""

from typing import Any, NamedTuple

import chex
import jax.numpy as jnp
from flax import struct

from attjax.control import linearized, square_root
from attjax.control.covariance import product
from attjax.control.linearized import AXES, Model
from attjax.control.square_root import PAIRS, Spread
from attjax.dynamics import vectors
from attjax.dynamics.vectors import Vector
from attjax.envs.context import Context


class Identity(struct.PyTreeNode):
    """What is known of a spacecraft's response, by components.

    Attributes:
        rate: as the gyro tells it, by this filter: ω and the gyro's bias, rad/s.
        mobility: N, elements as of PAIRS, 1/(kg m²).
        columns: B_a, (axes,) of vectors, 1/(kg m²).
        strengths: (valves,) share that each level about each axis gives of what it is asked.
        variances: (valves,) of these.
        spread: of the errors.
    """

    rate: Vector
    mobility: tuple[Any, ...]
    columns: tuple[Vector, ...]
    strengths: tuple[Any, ...]
    variances: tuple[Any, ...]
    spread: Spread

    @property
    def inertia(self) -> vectors.Matrix:
        """Rows of I = N⁻¹, kg m²."""
        return inverted(self.mobility)


class Period(NamedTuple):
    """A control period, as it was predicted.

    Attributes:
        before, after: the estimator's rate at its beginning, and predicted at its end, rad/s.
        impulses: (valves,) that were commanded in it, N m s, signed.
        unexplained: (3,) variances of the rate by what else is unknown of it, rad²/s².
        bias: of the gyro, by the estimator, rad/s.
    """

    before: Vector
    after: Vector
    impulses: tuple[Any, ...]
    unexplained: tuple[Any, ...]
    bias: Vector = (0.0, 0.0, 0.0)


def inverted(elements: tuple[Any, ...]) -> vectors.Matrix:
    """Rows of the inverse of a symmetric matrix with elements as of PAIRS."""
    a, b, c = rows = symmetric(elements)
    adjugate = vectors.cross(b, c), vectors.cross(c, a), vectors.cross(a, b)
    factor = 1 / vectors.dot(rows[0], adjugate[0])
    return tuple(vectors.scaled(factor, x) for x in adjugate)  # type: ignore[return-value]


def symmetric(elements: tuple[Any, ...]) -> vectors.Matrix:
    """Rows of a symmetric matrix with elements as of PAIRS."""
    xx, xy, xz, yy, yz, zz = elements
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


def unknowing(context: Context) -> Identity:
    """What is believed before anything is measured, with what is known of its errors."""
    inertia, wrong, count = context.inertia, context.knowledge.doubt, context.torque_axes
    dtype, eye = inertia.dtype, jnp.eye(3, dtype=inertia.dtype)
    moments, axes = (inertia, eye) if inertia.ndim == 1 else jnp.linalg.eigh(inertia)
    parts = [jnp.outer(axis, axis) / moment for axis, moment in zip(axes.T, moments)]
    mobility: Any = sum(parts[1:], parts[0])
    directions = torque_directions(context)
    turned = [jnp.stack([jnp.cross(axis, row) for row in mobility.T]).T for axis in eye]
    errors = [(wrong.inertia, mobility), *((wrong.moments, x) for x in parts)]
    errors += [(wrong.turned, x + x.T) for x in turned]
    most = 1 / jnp.min(moments) - 1 / jnp.max(moments)  # by which turning changes N at most
    squared = 2**0.5 * wrong.turned**2 * most
    errors += [(squared / 2, _both(axes.T[i], axes.T[j])) for i, j in PAIRS]
    roots = [share * _vector(x, directions @ x) for share, x in errors]
    for number, direction in enumerate(directions):
        far = eye[jnp.argmin(jnp.abs(direction))]
        first = jnp.cross(direction, far) / jnp.linalg.norm(jnp.cross(direction, far))
        across = first, jnp.cross(direction, first)
        gain = jnp.hypot(wrong.gain, wrong.tilt**2)  # what is turned away is less along
        for share, way in ((gain, direction), *((wrong.tilt, x) for x in across)):
            column = jnp.zeros((count, 3), dtype).at[number].set(mobility @ way)
            roots.append(share * _vector(jnp.zeros((3, 3), dtype), column))
    root, valves = jnp.stack(roots, axis=1), valves_of(context)
    zero, one = jnp.zeros((), dtype), jnp.ones((), dtype)
    return Identity(
        rate=(zero,) * 3,
        mobility=tuple(mobility[i, j] for i, j in PAIRS),
        columns=vectors.components(directions @ mobility),
        strengths=(one,) * valves,
        variances=(zero,) * valves,
        spread=Spread(
            rate=jnp.zeros((3, 3), dtype),
            cross=jnp.zeros((3, len(root)), dtype),
            response=square_root.of_wide(root),
        ),
    )


def _both(a, b):
    return jnp.outer(a, b) + jnp.outer(b, a)


def _vector(mobility, columns):
    """Errors of N and B in the filter's order."""
    of_mobility = jnp.stack([mobility[i, j] for i, j in PAIRS])
    return jnp.concatenate([of_mobility, columns.reshape(-1)])


def valves_of(context: Context) -> int:
    """How many levels about an axis there are, over all axes; of real actions, the axes."""
    return context.torque_axes if context.continuous else (len(context.torque_table) - 1) // 2


def torque_directions(context: Context) -> chex.Array:
    """(axes, 3) unit vectors of the torque axes as believed, body frame."""
    if context.continuous:
        return jnp.eye(3, dtype=context.torque_table.dtype)
    strongest = context.torque_table[1 : 1 + 2 * context.torque_axes : 2]
    return strongest / jnp.linalg.norm(strongest, axis=1, keepdims=True)


def gyroscopic(mobility: tuple[Any, ...], rate: Vector) -> list[list[Any]]:
    """Derivatives of −N (ω × N⁻¹ ω), three rows, by the elements of N, as of PAIRS.

    Example:
        >>> [row[0] for row in gyroscopic((1.0, 0.0, 0.0, 1.0, 0.0, 1.0), (1.0, 1.0, 0.0))]
        [0.0, 0.0, -1.0]
    """
    rows, inertia = symmetric(mobility), inverted(mobility)
    momentum = vectors.times(inertia, rate)
    turning = vectors.cross(rate, momentum)
    swung = [vectors.times(rows, vectors.cross(rate, column)) for column in inertia]
    found: list[list[Any]] = [[], [], []]
    for i, j in PAIRS:
        once = [(i, j)] if i == j else [(i, j), (j, i)]
        for row in AXES:
            terms = [momentum[b] * swung[a][row] for a, b in once]
            terms += [-turning[b] for a, b in once if a == row]
            found[row].append(sum(terms[1:], terms[0]))
    return found


def sensitivities(
    identity: Identity, period: Period, model: Model
) -> tuple[list[list[Any]], list[Vector]]:
    """How errors before a period become those of the rate after it.

    Returns:
        Three rows by the errors of rate, mobility and columns; and for each axis what an impulse
        of 1 N m s about it has become of the rate by the end.
    """
    total, start = impulses(identity, period), period.before
    if not model.held.value:  # given at the beginning
        for impulse, column in zip(total, identity.columns):
            start = vectors.add(start, vectors.scaled(impulse, column))
    mean = vectors.scaled(0.5, vectors.add(start, period.after))
    momentum = vectors.times(model.inertia, mean)
    carried = linearized.rate_transition(momentum, mean, model)
    kept = carried
    if model.held.value:  # given all through the period, not at its beginning
        kept = [[(x + (i == j)) / 2 for j, x in enumerate(row)] for i, row in enumerate(carried)]
    turning = gyroscopic(identity.mobility, mean)
    axes, rows = len(identity.columns), []
    for i in AXES:
        pushed = [kept[i][j] * total[a] for a in range(axes) for j in AXES]
        rows.append([*carried[i], *(model.period * x for x in turning[i]), *pushed])
    kicks: list[Any] = [tuple(product(row, x) for row in kept) for x in identity.columns]
    return rows, kicks


def impulses(identity: Identity, period: Period) -> list[Any]:
    """About each axis, N m s, of all its levels, as strong as they are."""
    given = [c * s for c, s in zip(period.impulses, identity.strengths)]
    axes = len(identity.columns)
    return [sum(given[a + axes :: axes], given[a]) for a in range(axes)]
