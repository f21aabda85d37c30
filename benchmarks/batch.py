"""Many spacecraft in NumPy arrays: what the peers that are not JAX share, and plain NumPy."""

import functools

import jax
import numpy as np

import attjax
from attjax import AttitudeEnv
from attjax.envs import initial_state, parameters
from attjax.envs.reward import OVERSPEED_PENALTY, TERMINAL_BONUS
from attjax.spacecraft import INTEGRATION_STEP, LM50

FRAMESKIP = 20
TOLERANCE = 1e-5
CHECKED_STEPS, CHECKED_SPACECRAFT = 20, 2048
ENV = AttitudeEnv(FRAMESKIP)
FLOAT, INTEGER = np.float32, np.int32


class Batch:
    """Spacecraft as arrays, one component after the other: (components, size).

    Subclasses fly them: ``full(actions)``, actions (steps, size) int32, with observation
    (Eq. 11), paper reward and, where an episode ended, a new one.
    """

    def __init__(self, num_envs: int, multiple: int = 1):
        self.size = -(-num_envs // multiple) * multiple
        self.params = ENV.default_params
        draw = jax.jit(jax.vmap(initial_state.initial_state, (0, None)))
        state = draw(jax.random.split(jax.random.key(0), self.size), self.params)
        self.quaternion = _aligned((4, self.size), FLOAT)
        self.angular_velocity = _aligned((3, self.size), FLOAT)
        self.time = _aligned((self.size,), INTEGER)
        self.observation = _aligned((11, self.size), FLOAT)
        self.reward = _aligned((self.size,), FLOAT)
        self.ended = _aligned((self.size,), INTEGER)
        self.quaternion[:] = np.asarray(state.quaternion).T

    def state(self) -> parameters.EnvState:
        """The state as attjax has it."""
        arrays = self.quaternion.T, self.angular_velocity.T, self.time
        return parameters.EnvState(*(jax.numpy.array(np.array(x)) for x in arrays))


def _aligned(shape, kind):
    """Zeros that start at a cache line."""
    size = int(np.prod(shape)) * np.dtype(kind).itemsize
    memory = np.zeros(size + 64, np.uint8)
    start = -memory.ctypes.data % 64
    return memory[start : start + size].view(kind).reshape(shape)


def random_actions(steps: int, size: int, seed: int = 0) -> np.ndarray:
    """(steps, size) rows of Table 1, int32."""
    actions = LM50.num_actions
    return np.random.default_rng(seed).integers(0, actions, (steps, size), INTEGER)


def check_physics(batch: Batch) -> float:
    """Largest difference of ``batch.physics`` from attjax.step over a trajectory.

    Raises:
        ArithmeticError: it is TOLERANCE or more.
    """
    _spin(batch)
    reference = batch.state()
    step = jax.jit(jax.vmap(functools.partial(attjax.step, frameskip=FRAMESKIP)))
    for actions in random_actions(CHECKED_STEPS, batch.size):
        reference = step(reference, actions)
        batch.physics(actions[None])
    return _compared(
        batch,
        (batch.quaternion.T, reference.quaternion),
        (batch.angular_velocity.T, reference.angular_velocity),
    )


def check_full(batch: Batch) -> float:
    """Largest difference of ``batch.full`` from the environment's step over some steps.

    Observations count where no episode ended. Two rewards may differ by the 1 of Eq. 12 where
    rounding decides whether q_s rose; such are at most one in a thousand.

    Raises:
        ArithmeticError: it is TOLERANCE or more.
    """
    _spin(batch)
    batch.time[:] = np.arange(batch.size) % (int(batch.params.max_steps_in_episode) + 1)
    step = jax.jit(jax.vmap(ENV.step_env, (None, 0, 0, None)))
    worst = 0.0
    for actions in random_actions(CHECKED_STEPS, batch.size, seed=1):
        start = batch.state()
        batch.full(actions[None])
        observation, _, reward, terminated, info = step(
            jax.random.key(0), start, actions, batch.params
        )
        ended = terminated + 2 * info["truncated"]
        ongoing = np.asarray(ended == 0)
        rewards = np.sort(np.abs(batch.reward - reward))[: round(0.999 * batch.size)]
        worst = max(worst, _compared(
            batch,
            (batch.observation.T[ongoing], observation[ongoing]),
            (rewards, 0),
            (batch.ended, ended),
        ))  # fmt: skip
    return worst


def _spin(batch):
    """Rates, without which rounding would decide whether q_s rose."""
    batch.angular_velocity[:] = np.random.default_rng(0).uniform(-0.2, 0.2, (3, batch.size))


def _compared(batch, *pairs):
    worst = max(float(np.max(np.abs(a - b), initial=0)) for a, b in pairs)
    if not worst < TOLERANCE:
        name = type(batch).__name__
        raise ArithmeticError(f"{name} differs from attjax by {worst:.2g}: no figures are printed")
    return worst


class NumpyBatch(Batch):
    """Plain NumPy, vectorised over the spacecraft."""

    def __init__(self, num_envs: int):
        super().__init__(num_envs)
        self.random = np.random.default_rng(0)
        first, second, third = np.asarray(self.params.inertia)
        self.gyroscopic = (
            (second - third) / first,
            (third - first) / second,
            (first - second) / third,
        )
        self.table = np.asarray(self.params.torque_table / self.params.inertia).T

    def full(self, actions: np.ndarray) -> None:
        """Fly (steps, size) actions."""
        for row in actions:
            before = self.quaternion.copy()
            self._propagate(self.table[:, row])
            self._judge(before)
            self._restart(np.flatnonzero(self.ended))
            self.observation[:4], self.observation[8:] = self.quaternion, self.angular_velocity
            state = np.concatenate([self.quaternion, self.angular_velocity])
            self.observation[4:8] = self._rates(state, None)[:4]

    def _propagate(self, acceleration):
        state = np.concatenate([self.quaternion, self.angular_velocity])
        for push in (acceleration, *[None] * FRAMESKIP):
            k1 = self._rates(state, push)
            k2 = self._rates(state + INTEGRATION_STEP / 2 * k1, push)
            k3 = self._rates(state + INTEGRATION_STEP / 2 * k2, push)
            k4 = self._rates(state + INTEGRATION_STEP * k3, push)
            state += INTEGRATION_STEP / 6 * (k1 + 2 * (k2 + k3) + k4)
        self.quaternion[:] = state[:4] / np.sqrt(np.sum(state[:4] ** 2, axis=0))
        self.angular_velocity[:] = state[4:]

    def _rates(self, state, acceleration):
        """Eq. 6 and 9."""
        q1, q2, q3, qs, w1, w2, w3 = state
        c1, c2, c3 = self.gyroscopic
        rates = np.empty_like(state)
        rates[0] = 0.5 * (w3 * q2 - w2 * q3 + w1 * qs)
        rates[1] = 0.5 * (w1 * q3 - w3 * q1 + w2 * qs)
        rates[2] = 0.5 * (w2 * q1 - w1 * q2 + w3 * qs)
        rates[3] = -0.5 * (w1 * q1 + w2 * q2 + w3 * q3)
        rates[4:] = c1 * w2 * w3, c2 * w3 * w1, c3 * w1 * w2
        if acceleration is not None:
            rates[4:] += acceleration
        return rates

    def _judge(self, before):
        """Eq. 12 and 13, and which episodes ended."""
        params, after = self.params, self.quaternion
        sine_before, sine = (np.sum(q[:3] ** 2, axis=0) for q in (before, after))
        angle = 2 * np.arctan2(np.sqrt(sine), after[3])
        improved = np.where(
            (before[3] > 0.5) & (after[3] > 0.5),
            sine < sine_before,
            np.where(
                (before[3] < -0.5) & (after[3] < -0.5), sine > sine_before, after[3] > before[3]
            ),
        )
        inside = angle <= float(params.goal_angle)
        self.time += 1
        speed = np.sqrt(np.sum(self.angular_velocity**2, axis=0))
        terminated = speed > float(params.rate_limit)
        truncated = ~terminated & (self.time >= int(params.max_steps_in_episode))
        reward = np.exp(angle / FLOAT(-0.14 * 2 * np.pi)) - ~improved + FLOAT(9) * inside
        reward = np.where(truncated, TERMINAL_BONUS * inside, reward)
        self.reward[:] = np.where(terminated, OVERSPEED_PENALTY, reward)
        self.ended[:] = terminated + 2 * truncated

    def _restart(self, rows):
        axis = self.random.normal(size=(3, len(rows)))
        low, high = float(self.params.min_slew_angle), float(self.params.max_slew_angle)
        half = self.random.uniform(low, high, len(rows)) / 2
        self.quaternion[:3, rows] = axis / np.linalg.norm(axis, axis=0) * np.sin(half)
        self.quaternion[3, rows] = np.cos(half)
        self.angular_velocity[:, rows] = 0
        self.time[rows] = 0
