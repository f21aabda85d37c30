"""A control period of any plant, written with matrices and independent of attjax; by the batch."""

import numpy as np

from attjax.envs.bounds import Bounds, WheelBounds

STEPS = 6


def peak_squared(inertia, rate):
    """ω·Aω of (n, 3, 3) inertias and (n, 3) rates: the square of the peak rate while coasting."""
    low, _, high = np.moveaxis(np.linalg.eigvalsh(inertia), -1, 0)
    momentum = np.einsum("nij,nj->ni", inertia, rate)
    energy = np.sum(momentum * rate, axis=-1)
    return ((low + high) * energy - np.sum(momentum**2, axis=-1)) / (low * high)


def after_period(inertia, rate, impulse, disturbance, period, duration, momentum=None):
    """The rates (n, 3) after a period, by RK4.

    Args:
        inertia: (n, 3, 3) kg m².
        rate: (n, 3) rad/s.
        impulse: (n, 3) of the command, at the period's beginning, N m s.
        disturbance: (n, 3) N m, all the time.
        period, duration: of the command, s.
        momentum: (n, 3) of body and wheels together, N m s; None: it has none.
    """
    inverse = np.linalg.inv(inertia)

    def rates(w, torque):
        h = np.einsum("nij,nj->ni", inertia, w) if momentum is None else momentum
        return np.einsum("nij,nj->ni", inverse, torque - np.cross(w, h))

    for span, torque in (
        (duration, impulse / duration + disturbance),
        (period - duration, disturbance),
    ):
        dt = span / STEPS
        for _ in range(STEPS if span > 0 else 0):
            k1 = rates(rate, torque)
            k2 = rates(rate + dt / 2 * k1, torque)
            k3 = rates(rate + dt / 2 * k2, torque)
            k4 = rates(rate + dt * k3, torque)
            rate = rate + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return rate


def within(**given) -> Bounds:
    """Bounds that are those of the ideal world of 19 actions, but for what is given."""
    actions = len(given.get("offset", np.zeros(19)))
    ideal = Bounds(
        factors=(1.0, 1.0), turned=0.0, share=np.ones((2, actions)), tilt=0.0,
        offset=np.zeros(actions), disturbance=0.0, late=0.0, uncounted=0.0, rate=0.0, attitude=0.0,
        waits=(0.0, 0.0), duration=40.0,
    )  # fmt: skip
    return ideal._replace(**given)


def turn(rng, count, angle):
    """(count, 3, 3) turns about random axes, by up to an angle; some by all of it."""
    from scipy.spatial.transform import Rotation

    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    by = angle * np.minimum(1, rng.uniform(0, 2, (count, 1)))
    return Rotation.from_rotvec(axis * by).as_matrix()


def unit(rng, count):
    """(count, 3) random unit vectors."""
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def ends(rng, low, high, shape):
    """Numbers from low to high, half of them at an end."""
    share = np.clip(rng.uniform(-0.5, 1.5, shape), 0, 1)
    return low + share * (np.asarray(high) - low)


def drawn(rng, believed, bounds, impulse, count):
    """Plants within bounds: inertias (n, 3, 3), and what becomes of the impulses (n, 3).

    Args:
        rng: of the draws.
        believed: (3, 3) inertia.
        bounds: that they are within.
        impulse: (n, 3) as believed, and which of the actions each is.
        count: n.
    """
    impulse, action = impulse
    moments, axes = np.linalg.eigh(believed)
    moments = moments * ends(rng, *bounds.factors, (count, 3))
    others = np.roll(moments, 1, axis=1) + np.roll(moments, 2, axis=1)
    moments = np.minimum(moments, others)
    axes = turn(rng, count, bounds.turned) @ axes
    inertia = np.einsum("nij,nj,nkj->nik", axes, moments, axes)
    share = ends(rng, *(bounds.share[:, action]), count)[:, None]
    tilted = np.einsum("nij,nj->ni", turn(rng, count, bounds.tilt), impulse)
    return inertia, share * tilted + bounds.offset[action][:, None] * unit(rng, count)


WHEELS = WheelBounds(axes=np.eye(3), tilt=0.0, length=3**0.5, share=0.0, stored=1e9, momentum=0.005)
