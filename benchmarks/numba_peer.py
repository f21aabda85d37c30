"""Peers compiled by Numba: a helper for each RK4 step (the authors' way), and a whole batch."""

import math

import numba
import numpy as np
from batch import FLOAT, FRAMESKIP, Batch
from single import INERTIA, SingleSlew

from attjax.envs.reward import OVERSPEED_PENALTY, TERMINAL_BONUS
from attjax.spacecraft import INTEGRATION_STEP

STEP, HALF_STEP, SIXTH_STEP = FLOAT(INTEGRATION_STEP / np.array([1, 2, 6]))
ZERO, HALF, ONE, TWO, NINE = FLOAT([0, 0.5, 1, 2, 9])
EXPONENT = FLOAT(-1 / (0.14 * 2 * np.pi))
BONUS, PENALTY = FLOAT(TERMINAL_BONUS), FLOAT(OVERSPEED_PENALTY)


@numba.njit
def _rates_of_one(state, torque, inertia):
    """Eq. 6 and 9 for a (7,) state."""
    q1, q2, q3, qs, w1, w2, w3 = state
    momentum = inertia * state[4:]
    rates = np.empty(7)
    rates[0] = 0.5 * (w3 * q2 - w2 * q3 + w1 * qs)
    rates[1] = 0.5 * (w1 * q3 - w3 * q1 + w2 * qs)
    rates[2] = 0.5 * (w2 * q1 - w1 * q2 + w3 * qs)
    rates[3] = -0.5 * (w1 * q1 + w2 * q2 + w3 * q3)
    rates[4:] = (torque - np.cross(state[4:], momentum)) / inertia
    return rates


@numba.njit
def _rk4_of_one(state, torque, inertia, dt):
    k1 = _rates_of_one(state, torque, inertia)
    k2 = _rates_of_one(state + dt / 2 * k1, torque, inertia)
    k3 = _rates_of_one(state + dt / 2 * k2, torque, inertia)
    k4 = _rates_of_one(state + dt * k3, torque, inertia)
    return state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


class NumbaSlew(SingleSlew):
    """A Gym environment that calls a compiled RK4 step from Python, in float64."""

    def _place(self, quaternion, angular_velocity):
        self.quaternion, self.angular_velocity = quaternion, angular_velocity

    def _propagate(self, torque):
        state = np.concatenate([self.quaternion, self.angular_velocity])
        for step in range(1 + FRAMESKIP):
            acting = torque if step == 0 else np.zeros(3)
            state = _rk4_of_one(state, acting, INERTIA, INTEGRATION_STEP)
            state[:4] /= np.linalg.norm(state[:4])
        self._place(state[:4], state[4:])


@numba.njit
def _rates(state, acceleration, gyroscopic):
    q1, q2, q3, qs, w1, w2, w3 = state
    return (
        HALF * (w3 * q2 - w2 * q3 + w1 * qs),
        HALF * (w1 * q3 - w3 * q1 + w2 * qs),
        HALF * (w2 * q1 - w1 * q2 + w3 * qs),
        -HALF * (w1 * q1 + w2 * q2 + w3 * q3),
        gyroscopic[0] * w2 * w3 + acceleration[0],
        gyroscopic[1] * w3 * w1 + acceleration[1],
        gyroscopic[2] * w1 * w2 + acceleration[2],
    )


@numba.njit
def _advance(s, dt, k):
    return (
        s[0] + dt * k[0],
        s[1] + dt * k[1],
        s[2] + dt * k[2],
        s[3] + dt * k[3],
        s[4] + dt * k[4],
        s[5] + dt * k[5],
        s[6] + dt * k[6],
    )


@numba.njit
def _rk4(state, acceleration, gyroscopic):
    k1 = _rates(state, acceleration, gyroscopic)
    k2 = _rates(_advance(state, HALF_STEP, k1), acceleration, gyroscopic)
    k3 = _rates(_advance(state, HALF_STEP, k2), acceleration, gyroscopic)
    k4 = _rates(_advance(state, STEP, k3), acceleration, gyroscopic)
    total = _advance(_advance(_advance(k1, TWO, k2), TWO, k3), ONE, k4)
    return _advance(state, SIXTH_STEP, total)


@numba.njit
def _reward(before, after, goal_angle, terminated, truncated):
    """Eq. 12 and 13."""
    sine_before = before[0] ** 2 + before[1] ** 2 + before[2] ** 2
    sine = after[0] ** 2 + after[1] ** 2 + after[2] ** 2
    angle = TWO * math.atan2(math.sqrt(sine), after[3])
    inside = angle <= goal_angle
    improved = after[3] > before[3]
    if before[3] > HALF and after[3] > HALF:
        improved = sine < sine_before
    elif before[3] < -HALF and after[3] < -HALF:
        improved = sine > sine_before
    if terminated:
        return PENALTY
    if truncated:
        return BONUS if inside else ZERO
    reward = math.exp(angle * EXPONENT)
    if not improved:
        reward -= ONE
    return reward + NINE if inside else reward


@numba.njit
def _restart(quaternion, angular_velocity, i, slew_angles):
    cosine, azimuth = np.random.uniform(-1, 1), np.random.uniform(0, 2 * math.pi)
    half = np.random.uniform(slew_angles[0], slew_angles[1]) / 2
    sine = math.sqrt(1 - cosine**2)
    quaternion[0, i] = sine * math.cos(azimuth) * math.sin(half)
    quaternion[1, i] = sine * math.sin(azimuth) * math.sin(half)
    quaternion[2, i] = cosine * math.sin(half)
    quaternion[3, i] = math.cos(half)
    angular_velocity[:, i] = 0


@numba.njit
def _fly(actions, q, w, time, observation, reward, ended, table, gyroscopic, limits):
    rate_limit, goal_angle, low, high, max_steps = limits
    coasting = (ZERO, ZERO, ZERO)
    for step in range(len(actions)):
        for i in range(len(time)):
            row = table[actions[step, i]]
            before = (q[0, i], q[1, i], q[2, i], q[3, i], w[0, i], w[1, i], w[2, i])
            s = _rk4(before, (row[0], row[1], row[2]), gyroscopic)
            for _ in range(FRAMESKIP):
                s = _rk4(s, coasting, gyroscopic)
            norm = math.sqrt(s[0] ** 2 + s[1] ** 2 + s[2] ** 2 + s[3] ** 2)
            s = (s[0] / norm, s[1] / norm, s[2] / norm, s[3] / norm, s[4], s[5], s[6])
            time[i] += 1
            terminated = math.sqrt(s[4] ** 2 + s[5] ** 2 + s[6] ** 2) > rate_limit
            truncated = not terminated and time[i] >= max_steps
            reward[i] = _reward(before, s, goal_angle, terminated, truncated)
            ended[i] = terminated + 2 * truncated
            q[0, i], q[1, i], q[2, i], q[3, i], w[0, i], w[1, i], w[2, i] = s
            if terminated or truncated:
                _restart(q, w, i, (low, high))
                time[i] = 0
                s = (q[0, i], q[1, i], q[2, i], q[3, i], w[0, i], w[1, i], w[2, i])
            rates = _rates(s, coasting, gyroscopic)
            for k in range(4):
                observation[k, i], observation[4 + k, i] = s[k], rates[k]
            for k in range(3):
                observation[8 + k, i] = s[4 + k]


class NumbaBatch(Batch):
    """A compiled loop over the spacecraft that does the whole agent step, in float32."""

    def __init__(self, num_envs: int):
        super().__init__(num_envs)
        first, second, third = np.asarray(self.params.inertia)
        self.gyroscopic = (
            (second - third) / first,
            (third - first) / second,
            (first - second) / third,
        )
        self.table = np.asarray(self.params.torque_table / self.params.inertia)
        params = self.params
        limits = (
            params.rate_limit,
            params.goal_angle,
            params.min_slew_angle,
            params.max_slew_angle,
            params.max_steps_in_episode,
        )
        self.limits = tuple(np.asarray(x)[()] for x in limits)

    def full(self, actions: np.ndarray) -> None:
        """Fly (steps, size) actions."""
        state = (self.quaternion, self.angular_velocity, self.time)
        results = (self.observation, self.reward, self.ended)
        _fly(actions, *state, *results, self.table, self.gyroscopic, self.limits)
