"""Rotation by SciPy and by Basilisk, independent of the code under test."""

import numpy as np
from bodies import LM50
from commands import ROOT
from scipy.integrate import solve_ivp

NO_TORQUE = np.zeros(3)
START = np.array([0.1, -0.5, 0.3, 0.8, 0.2, -0.3, 0.25])  # q (made unit below), ω
START[:4] /= np.linalg.norm(START[:4])


def reference(start, duration, torque=NO_TORQUE, inertia=LM50):
    """DOP853 on Eq. 6 and 9 written with matrices; independent of attjax."""
    inertia = np.diag(inertia) if np.ndim(inertia) == 1 else np.asarray(inertia)

    def rate(_, y):
        q, w = y[:4], y[4:]
        vector = 0.5 * (q[3] * w + np.cross(q[:3], w))
        return [
            *vector,
            -0.5 * q[:3] @ w,
            *np.linalg.solve(inertia, torque - np.cross(w, inertia @ w)),
        ]

    solution = solve_ivp(rate, (0, duration), start, "DOP853", rtol=1e-13, atol=1e-15)
    return solution.y[:, -1]


def basilisk(name, case):
    """Rows of what tests/data/basilisk_<name>.py wrote, of one case: its first column, left out."""
    file = ROOT / "tests" / "data" / f"basilisk_{name}.csv"
    rows = np.loadtxt(file, delimiter=",", skiprows=1)
    return rows[rows[:, 0] == case, 1:]


def quaternions_of(mrp):
    """Unit quaternions (n, 4), up to sign, of modified Rodrigues parameters (n, 3)."""
    square = np.sum(mrp**2, axis=1, keepdims=True)
    return np.hstack([2 * mrp, 1 - square]) / (1 + square)


def assert_same_attitude(quaternion, expected, tolerance):
    """Unit quaternions (n, 4) but for their signs."""
    sign = np.sign(np.sum(expected * quaternion, axis=1, keepdims=True))
    np.testing.assert_allclose(quaternion, sign * expected, rtol=0, atol=tolerance)
