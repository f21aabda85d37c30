"""One spacecraft as a Gym-style environment in Python: what Numba's and Basilisk's share."""

import math

import numpy as np

from attjax.envs import parameters
from attjax.envs.reward import OVERSPEED_PENALTY, TERMINAL_BONUS
from attjax.spacecraft import LM50

FRAMESKIP = 20
INERTIA = np.array(LM50.inertia)
TORQUES = np.array(LM50.torque_table)
PARAMS = parameters.default_params(FRAMESKIP)
RATE_LIMIT, GOAL_ANGLE = float(PARAMS.rate_limit), float(PARAMS.goal_angle)
MAX_STEPS = int(PARAMS.max_steps_in_episode)
SLEW_ANGLES = float(PARAMS.min_slew_angle), float(PARAMS.max_slew_angle)


class SingleSlew:
    """The paper's task, a Python call for each step; subclasses bring the physics.

    They define ``_place(quaternion, angular_velocity)`` and ``_propagate(torque)``, which
    return nothing and set the attributes ``quaternion`` and ``angular_velocity``.
    """

    def __init__(self):
        self.random = np.random.default_rng(0)
        self.reset()

    def reset(self) -> np.ndarray:
        """Start an episode; returns the observation (11,)."""
        axis = self.random.normal(size=3)
        half = self.random.uniform(*SLEW_ANGLES) / 2
        axis *= math.sin(half) / math.sqrt(axis @ axis)
        self._place(np.append(axis, math.cos(half)), np.zeros(3))
        self.time = 0
        return self._observe()

    def step(self, action: int):
        """One agent step. Returns observation, reward, terminated, truncated and {}."""
        before = self.quaternion[3]
        self._propagate(TORQUES[action])
        self.time += 1
        terminated = math.sqrt(self.angular_velocity @ self.angular_velocity) > RATE_LIMIT
        truncated = not terminated and self.time >= MAX_STEPS
        reward = self._reward(before, terminated, truncated)
        return self._observe(), reward, terminated, truncated, {}

    def fly(self, actions: np.ndarray) -> None:
        """Step through actions (steps,), with automatic reset."""
        for action in actions:
            _, _, terminated, truncated, _ = self.step(action)
            if terminated or truncated:
                self.reset()

    def _observe(self):
        """Eq. 11."""
        vector, scalar = self.quaternion[:3], self.quaternion[3]
        q1, q2, q3 = vector
        w1, w2, w3 = self.angular_velocity
        cross = np.array([q2 * w3 - q3 * w2, q3 * w1 - q1 * w3, q1 * w2 - q2 * w1])
        rate = 0.5 * (scalar * self.angular_velocity + cross)
        scalar_rate = -0.5 * (vector @ self.angular_velocity)
        return np.concatenate([self.quaternion, rate, [scalar_rate], self.angular_velocity])

    def _reward(self, before, terminated, truncated):
        """Eq. 12 and 13."""
        vector, scalar = self.quaternion[:3], self.quaternion[3]
        angle = 2 * math.atan2(math.sqrt(vector @ vector), scalar)
        inside = angle <= GOAL_ANGLE
        if terminated:
            return OVERSPEED_PENALTY
        if truncated:
            return TERMINAL_BONUS if inside else 0.0
        reward = math.exp(-angle / (0.14 * 2 * math.pi)) - (scalar <= before)
        return reward + 9 if inside else reward
