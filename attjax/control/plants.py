"""What the plants of a belief can do under an action: bounds that hold for every one of them.

Of a plant with the inertia I and P² = ω·Aω of its own peak rate
(:func:`attjax.dynamics.rigid_body.peak_rate_form`), coasting leaves P as it is, and a torque L
changes it by d(P²)/dt = 2 ω·G L with G = A I⁻¹. In the principal axes A, G and the square of I⁻¹ in
the norm of P are diagonal, and each of their elements has bounds where the moments have. With
reaction wheels P is ‖ω‖, and coasting changes it by what the momentum of all does. The proof is in
docs/assurance.md.
"""

import itertools

import chex
import jax
import jax.numpy as jnp
from flax import struct

from attjax.dynamics import rigid_body
from attjax.dynamics.numerics import matmul, square_root
from attjax.envs.bounds import Bounds
from attjax.envs.context import Context
from attjax.spacecraft import INTEGRATION_STEP


class Coefficients(struct.PyTreeNode):
    """Bounds of a diagonal in the principal axes, (3,) each.

    Attributes:
        form: largest of A.
        least_work, most_work: of G, 1/(kg m²).
        growth: largest of A I⁻², 1/(kg m²)².
    """

    form: chex.Array
    least_work: chex.Array
    most_work: chex.Array
    growth: chex.Array


class Plants(struct.PyTreeNode):
    """All plants within bounds, in the principal axes of the believed one.

    Attributes:
        axes: (3, 3) the principal axes, columns, body frame.
        coefficients: of the moments.
        turned: 2 sin(θ/2) of the angle θ by which the axes can be off.
        inverse: of the least moment, 1/(kg m²).
        impulse: (actions, 3) of each action, as believed, N m s.
        share: (2, actions) least and largest of it that there is.
        tilt: 2 sin(α/2) of the angle α by which its direction can be off.
        error: (actions,) what else there is at most, with a period's disturbance, N m s.
        growth: (actions,) the most that an action changes P by, from rest, rad/s.
        pushed: the same of a period's disturbance, rad/s.
        turning: (actions,) how long growth lasts, times it, rad.
        square, linear: what turns ω while it coasts is at most square P² + linear P, rad/s².
        feeding: P² grows by at most this share of it in a period, without any torque.
    """

    axes: chex.Array
    coefficients: Coefficients
    turned: chex.Array
    inverse: chex.Array
    impulse: chex.Array
    share: chex.Array
    tilt: chex.Array
    error: chex.Array
    growth: chex.Array
    pushed: chex.Array
    turning: chex.Array
    square: chex.Array
    linear: chex.Array
    feeding: chex.Array

    @property
    def form(self) -> chex.Array:
        """(3,) a diagonal of which ω·diag ω is at least P² of every plant."""
        form = self.coefficients.form
        return form + (jnp.max(form) - 1) * self.turned

    @property
    def most_growth(self) -> chex.Array:
        """(actions,) the most that P grows in a period, but for coasting, rad/s."""
        return self.growth + self.pushed

    @property
    def excess(self) -> chex.Array:
        """The most that the bound of P can be of the P of a plant, were the rate told exactly."""
        of = self.coefficients
        lightest = of.most_work / of.growth
        least = of.least_work * lightest - (jnp.max(of.form) - 1) * self.turned
        return jnp.sqrt(jnp.max(self.form / jnp.maximum(least, 1)))

    def peak(self, rate: chex.Array, error: chex.Numeric) -> chex.Array:
        """The most that P can be at a rate (3,), principal axes, told with an error; rad/s."""
        return square_root(jnp.sum(self.form * rate**2)) + self.of_error(error)

    def of_error(self, error: chex.Numeric) -> chex.Array:
        """The most that an error of the rate changes P by, rad/s."""
        return jnp.sqrt(jnp.max(self.form)) * error

    def work(self, rate: chex.Array) -> chex.Array:
        """(actions,) the most of ω·G J, with J the impulse of a period, (rad/s)².

        Args:
            rate: (3,) principal axes, rad/s.
        """
        of, speed = self.coefficients, _length(rate)
        straight = jnp.zeros(len(self.impulse), rate.dtype)
        for axis in range(3):  # one by one, as in C; a sum over an axis of three takes longer
            product = self.impulse[:, axis] * rate[axis]
            straight += jnp.maximum(of.most_work[axis] * product, of.least_work[axis] * product)
        working = _length(of.most_work * rate) + self.turned * self.inverse * speed
        worked = _length(of.most_work * self.impulse)
        off = (self.turned + self.tilt) * _length(self.impulse) * working
        off = off + self.turned * worked * speed
        return jnp.max(self.share * (straight + off), axis=0) + self.error * working

    @property
    def sensitivity(self) -> chex.Array:
        """(actions,) what an error of the rate adds to the work at most, rad/s."""
        worked = _length(self.coefficients.most_work * self.impulse)
        off = self.inverse * (self.turned + self.tilt) * _length(self.impulse)
        return self.share[1] * (worked + off) + self.inverse * self.error

    def beside(self, peak: chex.Numeric, error: chex.Numeric) -> chex.Array:
        """(actions,) the most that P² changes by in a period beside twice the work, (rad/s)².

        Args:
            peak: the most that P is at its beginning.
            error: of the rate, rad/s.
        """
        most = peak + self.most_growth
        turning = (self.square * most + self.linear) * most * self.turning
        squared = self.most_growth**2 + turning + self.feeding * most**2
        return squared + 2 * error * self.sensitivity


@jax.jit
def plants(context: Context, bounds: Bounds) -> Plants:
    """The plants of a belief.

    Args:
        context: of the loop.
        bounds: how far they can be from it.
    """
    moments, axes = _principal(context.inertia)
    low, high = (factor * moments for factor in bounds.factors)
    wheels, period = bounds.wheels, context.control_period
    inverse = 1 / jnp.min(low)
    if wheels is None:
        coefficients = _of_peak_rate(low, high)
        numbers: tuple = rigid_body.MOST_TURNING, 0.0, 0.0
    else:
        coefficients = Coefficients(jnp.ones(3, low.dtype), 1 / high, 1 / low, 1 / low**2)
        inverse_of_body = inverse * (1 + wheels.share)
        unequal = inverse_of_body - 1 / jnp.max(high)
        numbers = 0.0, inverse_of_body * wheels.momentum, unequal * wheels.momentum * period
    square, linear, feeding = (jnp.asarray(x, low.dtype) for x in numbers)
    turned, tilt = (
        2 * jnp.sin(jnp.asarray(x, low.dtype) / 2) for x in (bounds.turned, bounds.tilt)
    )
    impulse = matmul(context.torque_table, axes) * context.torque_duration
    share, offset = (jnp.asarray(x, low.dtype) for x in (bounds.share, bounds.offset))
    own = jnp.sqrt(jnp.sum(coefficients.growth * impulse**2, axis=-1))
    growth = share[1] * (own + inverse * (turned + tilt) * _length(impulse)) + inverse * offset
    disturbed = bounds.disturbance * period
    lasting = context.torque_duration + bounds.late * INTEGRATION_STEP
    return Plants(
        axes=axes,
        coefficients=coefficients,
        turned=turned,
        inverse=inverse,
        impulse=impulse,
        share=share,
        tilt=tilt,
        error=offset + disturbed,
        growth=growth,
        pushed=inverse * disturbed,
        turning=lasting * growth + period * inverse * disturbed,
        square=square,
        linear=linear,
        feeding=feeding,
    )


def _principal(inertia):
    if inertia.ndim == 1:
        return inertia, jnp.eye(3, dtype=inertia.dtype)
    return jnp.linalg.eigh(inertia)


def _length(vectors):
    return square_root(jnp.sum(vectors**2, axis=-1))


def _of_peak_rate(low, high):
    """Of P, the peak rate while coasting, for moments from low to high, (3,) each.

    Of a moment m beside x and y, G is the larger of 1/m and 1/x + 1/y − m/(x y), and A is m G. The
    second is linear in each of m, 1/x and 1/y, and so extreme in a corner; m times it, in x and y.
    A of the middle moment is at most 2 − I_min/m, as no moment exceeds the others' sum.
    """
    ends, least = (low, high), jnp.min(low)
    others = [(jnp.roll(a, 1), jnp.roll(b, 2)) for a, b in itertools.product(ends, repeat=2)]
    corners = jnp.stack([_middle(m, x, y) for m in ends for x, y in others])
    forms = jnp.stack([_form(jnp.clip((x + y) / 2, low, high), x, y) for x, y in others])
    most_form = jnp.minimum(jnp.max(forms, axis=0), 2 - least / high)
    most_work = jnp.minimum(jnp.max(corners, axis=0), (2 - least / high) / low)
    least_work = jnp.maximum(1 / high, jnp.min(corners, axis=0))
    most_work = jnp.maximum(1 / low, most_work)
    return Coefficients(jnp.maximum(most_form, 1), least_work, most_work, most_work / low)


def _middle(m, x, y):
    return 1 / x + 1 / y - m / (x * y)


def _form(m, x, y):
    return m * _middle(m, x, y)
