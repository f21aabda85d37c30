"""An independent account of wheels and a flexible mode: the whole mass matrix, solved by NumPy."""

from typing import NamedTuple

import numpy as np
from imperfect import Oracle, vector
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

STEP = 1 / 240


class Motion(NamedTuple):
    quaternion: np.ndarray
    rate: np.ndarray
    speeds: np.ndarray
    mode: np.ndarray

    @classmethod
    def of(cls, state):
        plant = state.plant
        aboard = plant.wheel_speeds, plant.deflection
        speeds, mode = (np.zeros(0) if x is None else x for x in aboard)
        return cls(*map(np.asarray, (state.quaternion, state.angular_velocity, speeds, mode)))


class MovingOracle:
    """Takes the numbers that were drawn from the plant, and nothing of how they are used."""

    def __init__(self, plant):
        outside = Oracle(plant)
        self.inertia, self.torque = outside.inertia, outside.torque
        self.wheels, mode = plant.wheels, plant.flexible
        count = 0 if self.wheels is None else len(self.wheels.axes)
        self.axes = np.array([vector(x) for x in self.wheels.axes]) if count else np.zeros((0, 3))
        self.wheel = float(self.wheels.inertia) if count else 0.0
        self.delta = np.zeros((0, 3)) if mode is None else vector(mode.vector)[None]
        self.spring = 0.0 if mode is None else float(mode.stiffness)
        self.damper = 0.0 if mode is None else float(mode.damping)
        apart = np.zeros((count, len(self.delta)))
        self.mass = np.block([
            [self.inertia, self.wheel * self.axes.T, self.delta.T],
            [self.wheel * self.axes, self.wheel * np.eye(count), apart],
            [self.delta, apart.T, np.eye(len(self.delta))],
        ])  # fmt: skip

    def momentum(self, motion):
        """Of the body and all aboard, in the target's frame, N m s."""
        own = self.inertia @ motion.rate + self.wheel * motion.speeds @ self.axes
        own = own + (motion.mode[1] * self.delta[0] if len(self.delta) else 0)
        return Rotation.from_quat(motion.quaternion).apply(own)

    def friction(self, speeds, part):
        """Of a kind that the wheels may lack."""
        size = getattr(self.wheels, part) if self.wheels is not None else None
        size = 0.0 if size is None else float(size)
        return size * (np.sign(speeds) if part == "coulomb" else speeds)

    def fly(self, motion, motors, steps, start=0, pulses=None):
        """The motion after so many RK4 steps' time.

        Args:
            motion: at the beginning.
            motors: of a step's number and the speeds at its beginning, their (wheels,) torques.
            steps: how many.
            start: RK4 steps since the episode's start.
            pulses: torques on the body by the number of the RK4 step in which they are on.
        """
        count = len(self.axes)

        def rates(time, y, motor, on):
            v, w, speeds, mode = np.split(y, [4, 7, 7 + count])
            attitude = Rotation.from_quat(v / np.linalg.norm(v))
            flexing = mode[1] * self.delta[0] if len(mode) else np.zeros(3)
            h = self.inertia @ w + self.wheel * speeds @ self.axes + flexing
            on_body = on + self.torque(time, attitude) - np.cross(w, h)
            on_wheels = motor - self.friction(speeds, "viscous")
            on_mode = [-self.damper * mode[1] - self.spring * mode[0]] if len(mode) else []
            turning = np.linalg.solve(self.mass, [*on_body, *on_wheels, *on_mode])
            vector_rate = (v[3] * w + np.cross(v[:3], w)) / 2
            later = [mode[1], turning[-1]] if len(mode) else []
            return [*vector_rate, -v[:3] @ w / 2, *turning[: 3 + count], *later]

        y = np.concatenate(motion)
        for n in range(steps):
            span = (start + n) * STEP, (start + n + 1) * STEP
            speeds = y[7 : 7 + count]
            held = motors(n, speeds) - self.friction(speeds, "coulomb")
            on = (pulses or {}).get(n, np.zeros(3))
            args = held, on
            y = solve_ivp(rates, span, y, "DOP853", args=args, rtol=1e-13, atol=1e-15).y[:, -1]
        v, *rest = np.split(y, [4, 7, 7 + count])
        return Motion(v / np.linalg.norm(v), *rest)
