"""An independent account of what moves a spacecraft in an imperfect world, in NumPy and SciPy."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

MU, EARTH_RADIUS = 3.986004418e14, 6.371e6
STEP = 1 / 240


def vector(components):
    return np.array([float(x) for x in components])


def tensor(inertia):
    inertia = np.asarray(inertia)
    return np.diag(inertia) if inertia.ndim == 1 else inertia


class Oracle:
    """Torques of a plant at any time, each by its textbook's formula, and the motion under them.

    It takes the numbers that were drawn from the plant, and nothing of how they are used.
    """

    def __init__(self, plant):
        self.inertia = tensor(plant.inertia)
        self.given, self.orbit = plant.disturbances, plant.orbit

    def place(self, time):
        """Unit vectors up and along the flight, and the orbit's radius, m."""
        rate = float(self.orbit.rate)
        angle = float(self.orbit.start) + rate * time
        node, ahead = vector(self.orbit.node), vector(self.orbit.ahead)
        turn = Rotation.from_rotvec(angle * np.cross(node, ahead))
        return turn.apply(node), turn.apply(ahead), (MU / rate**2) ** (1 / 3)

    def torque(self, time, attitude):
        """All but what is commanded, body frame; ``attitude`` leads from body to target."""
        total, given = np.zeros(3), self.given
        if given.gravity_gradient is not None:
            up, _, radius = self.place(time)
            r = attitude.inv().apply(up) * radius
            total += 3 * MU / radius**5 * np.cross(r, self.inertia @ r)
        if given.dipole is not None:
            total += np.cross(vector(given.dipole[0]), attitude.inv().apply(self.field(time)))
        if given.drag is not None:
            force = -attitude.inv().apply(self.place(time)[1])
            total += np.cross(vector(given.drag), force)
        if given.radiation is not None:
            lever, sun = map(vector, given.radiation)
            total += np.cross(lever, -attitude.inv().apply(sun))
        if given.constant is not None:
            total += vector(given.constant)
        if given.swinging is not None:
            amplitude, rate, phase = given.swinging
            total += vector(amplitude) * np.sin(float(rate) * time + float(phase))
        return total

    def field(self, time):
        """Of the Earth, target's frame, T."""
        earth = self.given.dipole[1]
        pole = vector(earth.pole)
        axis = -pole / np.linalg.norm(pole)  # the Earth's, as its dipole points south
        turn = Rotation.from_rotvec(axis * (float(earth.start) + 7.292115e-5 * time))
        dipole = pole + turn.apply(vector(earth.first))
        up, _, _ = self.place(time)
        return float(earth.strength) * (3 * (dipole @ up) * up - dipole)

    def fly(self, quaternion, rate, pulses, steps, start=0):
        """Quaternion and rate after so many RK4 steps' time.

        Args:
            quaternion, rate: at the beginning.
            pulses: torques by the number of the RK4 step in which they are on.
            steps: how many.
            start: RK4 steps since the episode's start.
        """

        def rates(time, y, commanded):
            v, w = y[:4], y[4:]
            attitude = Rotation.from_quat(v / np.linalg.norm(v))
            torque = commanded + self.torque(time, attitude)
            turning = np.linalg.solve(self.inertia, torque - np.cross(w, self.inertia @ w))
            vector_rate = (v[3] * w + np.cross(v[:3], w)) / 2
            return [*vector_rate, -v[:3] @ w / 2, *turning]

        y = np.concatenate([quaternion, rate])
        for n in range(steps):
            span = (start + n) * STEP, (start + n + 1) * STEP
            on = pulses.get(n, np.zeros(3))
            y = solve_ivp(rates, span, y, "DOP853", args=(on,), rtol=1e-13, atol=1e-15).y[:, -1]
        return y[:4] / np.linalg.norm(y[:4]), y[4:]
