"""What sensors say, against closed forms: when, of which moment, with which errors."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attjax import AttitudeEnv, World
from attjax.envs.parameters import measured

RATE = 0.2
"""rad/s about the first body axis: a coasting spacecraft keeps it."""

ARCSEC = np.deg2rad(1 / 3600)


def sensing(**sensors):
    return World.from_lists({"name": "test", "sensors": sensors})


def coasting(env, steps, seed=0, rate=RATE):
    """Measurements and states at the start and after each of so many agent steps."""
    params = env.default_params
    state = env.reset(jax.random.key(seed), params)[1]
    start = jnp.array([0.0, 0.0, 0.0, 1.0], state.quaternion.dtype)
    spinning = jnp.array([rate, 0.0, 0.0], state.quaternion.dtype)
    state = state.replace(quaternion=start, angular_velocity=spinning)

    def step(state, _):
        state = env.step_env(jax.random.key(0), state, 0, params)[1]
        return state, (measured(state), state)

    return jax.jit(lambda: jax.lax.scan(step, state, length=steps)[1])()


def angles(quaternions):
    return 2 * np.arctan2(np.asarray(quaternions)[:, 0], np.asarray(quaternions)[:, 3])


@pytest.mark.parametrize("frameskip", [5, 20, 100])
@pytest.mark.parametrize("rate_hz, latency", [(4, 0.05), (4, 0.25), (16, 0.0), (240, 1 / 240)])
def test_a_star_tracker_tells_the_moment_that_it_has_seen(x64, frameskip, rate_hz, latency):
    """At each decision, by hand: of each control period's last samples, the newest that is told."""
    env = AttitudeEnv(
        frameskip, world=sensing(star_tracker={"rate_hz": rate_hz, "latency": latency})
    )
    told, _ = coasting(env, 40)
    period, delay, told_angles = 240 // rate_hz, round(latency * 240), angles(told.quaternion)
    kept, told_before = [0], 0 if delay == 0 else -1
    for n in range(40):
        start, now = n * (frameskip + 1), (n + 1) * (frameskip + 1)
        kept += [t for t in range(start + 1, now + 1) if t % period == 0][-1:]
        newest = max((t for t in kept if t + delay <= now), default=-1)
        assert bool(told.has_quaternion[n]) == (newest > told_before)
        told_before = newest
        if newest > 0:
            np.testing.assert_allclose(told_angles[n], RATE * newest / 240, atol=1e-12)


def test_a_gyro_tells_its_own_moments(x64):
    """20 Hz at decisions of 40 Hz: every other one is new; while the rate grows by pulses."""
    env = AttitudeEnv(5, world=sensing(gyro={"rate_hz": 20}))
    params = env.default_params
    state = env.reset(jax.random.key(0), params)[1]
    before = np.zeros(3)
    for n in range(8):
        state = env.step_env(jax.random.key(0), state, 1, params)[1]
        told = measured(state)
        assert bool(told.has_angular_velocity) == (n % 2 == 1)
        expected = state.angular_velocity if n % 2 else before
        np.testing.assert_allclose(told.angular_velocity, expected, atol=1e-14)
        before = np.asarray(told.angular_velocity)


def test_sensors_without_errors_tell_the_truth():
    env = AttitudeEnv(5, world=sensing(gyro={"resolution": 1e-30}, star_tracker={"most_rate": 50}))
    told, states = coasting(env, 20)
    assert np.all(told.has_quaternion) and np.all(told.has_angular_velocity)
    np.testing.assert_allclose(told.quaternion, states.quaternion, atol=1e-7)
    plain, _ = coasting(AttitudeEnv(5), 20)
    np.testing.assert_allclose(told.quaternion, plain.quaternion, atol=1e-6)


def readings(env, count, rate=RATE):
    """Rotation vectors of attitude errors, body frame, and rate errors, of many spacecraft."""
    run = jax.vmap(lambda seed: coasting(env, 2, seed, rate))
    told, states = jax.jit(run)(jnp.arange(count))
    told, states = jax.tree.map(lambda x: np.asarray(x[:, -1], float), (told, states))
    error = Rotation.from_quat(states.quaternion).inv() * Rotation.from_quat(told.quaternion)
    return error.as_rotvec(), told.angular_velocity - states.angular_velocity


def test_a_star_trackers_covariance_is_as_described(x64):
    """10″ across and 60″ about a boresight between axes, over 4,000 spacecraft."""
    boresight = np.array([1.0, 2.0, 2.0]) / 3
    table = {"cross_boresight_arcsec": 10, "roll_arcsec": 60, "boresight": [1, 2, 2]}
    errors, _ = readings(AttitudeEnv(5, world=sensing(star_tracker=table)), 4000)
    about = np.outer(boresight, boresight)
    expected = ARCSEC**2 * (10**2 * (np.eye(3) - about) + 60**2 * about)
    np.testing.assert_allclose(np.cov(errors.T), expected, atol=0.06 * 60**2 * ARCSEC**2)
    turned = np.linalg.qr(np.column_stack([boresight, np.eye(3)[:2].T]))[0]
    across = np.std(errors @ turned[:, 1:], axis=0) / ARCSEC
    np.testing.assert_allclose(across, 10, rtol=0.05)
    np.testing.assert_allclose(errors.mean(axis=0), 0, atol=4 * 60 * ARCSEC / 4000**0.5)


def test_a_star_tracker_is_blind_above_its_rate():
    env = AttitudeEnv(5, world=sensing(star_tracker={"most_rate": 0.1}))
    for rate, sees in ((0.09, True), (0.11, False)):
        told, _ = coasting(env, 3, rate=rate)
        assert np.all(np.asarray(told.has_quaternion) == sees)


def test_a_gyros_errors_are_as_described(x64):
    """Noise of a sample, bias, scale factors and misalignment, over 4,000 spacecraft."""
    env = AttitudeEnv(5, world=sensing(gyro={"angle_random_walk_deg_per_root_h": 0.06}))
    _, errors = readings(env, 4000)
    sigma = np.deg2rad(0.06) / 60 / np.sqrt(6 / 240)
    np.testing.assert_allclose(np.cov(errors.T) / sigma**2, np.eye(3), atol=0.08)

    _, errors = readings(AttitudeEnv(5, world=sensing(gyro={"bias_deg_per_h": 3600})), 2000)
    np.testing.assert_allclose(np.linalg.norm(errors, axis=1), np.deg2rad(1), rtol=1e-9)
    np.testing.assert_allclose(errors.mean(axis=0), 0, atol=4 * np.deg2rad(1) / 2000**0.5)

    table = {"scale_factor_ppm": {"uniform": [-1000, 1000]}}
    _, errors = readings(AttitudeEnv(5, world=sensing(gyro=table)), 2000)
    assert np.all(errors[:, 1:] == 0) and np.abs(errors[:, 0]).max() <= 1.0001e-3 * RATE
    np.testing.assert_allclose(errors[:, 0].std(), RATE * 1e-3 / 3**0.5, rtol=0.05)

    _, errors = readings(AttitudeEnv(5, world=sensing(gyro={"misalignment_arcsec": 3600})), 2000)
    np.testing.assert_allclose(errors[:, 0], RATE * (np.cos(np.deg2rad(1)) - 1), rtol=1e-6)
    np.testing.assert_allclose(errors[:, 1].std(), RATE * np.sin(np.deg2rad(1)) / 2**0.5, rtol=0.06)


def test_a_gyro_has_a_range_and_a_resolution(x64):
    world = sensing(gyro={"rate_limit": 0.15, "resolution": 0.04})
    for rate, says in ((0.2, 0.16), (0.1, 0.08), (-0.09, -0.08), (0.01, 0)):
        told, _ = coasting(AttitudeEnv(5, world=world), 1, rate=rate)
        np.testing.assert_allclose(told.angular_velocity[0], [says, 0, 0], atol=1e-12)


def allan_variance(rates, samples):
    """Overlapping Allan variance of (time, series) for averages over so many samples."""
    sums = np.cumsum(np.concatenate([np.zeros((1, rates.shape[1])), rates]), axis=0)
    means = (sums[samples:] - sums[:-samples]) / samples
    return np.mean((means[samples:] - means[:-samples]) ** 2, axis=0).mean() / 2


def test_a_gyros_allan_deviation_is_its_specification(x64):
    """Angle random walk at short times, bias instability at the top; 60 axes for 1,600 s, 10 Hz.

    A Gauss-Markov process of deviation σ and correlation time T has the Allan variance
    2σ²T/τ (1 − T/(2τ) (3 − 4 exp(−τ/T) + exp(−2τ/T))).
    """
    walk, top, time = 0.1, 20.0, 40.0
    table = {
        "angle_random_walk_deg_per_root_h": walk,
        "bias_instability_deg_per_h": top,
        "bias_correlation_time": time,
    }
    env = AttitudeEnv(23, world=sensing(gyro=table))
    told, _ = jax.jit(jax.vmap(lambda seed: coasting(env, 16_000, seed, 0.0)))(jnp.arange(20))
    rates = np.asarray(told.angular_velocity).transpose(1, 0, 2).reshape(16_000, -1)
    rates = np.rad2deg(rates) * 3600  # °/h
    for samples in (1, 10, 100, 760):
        tau = samples / 10
        white = (walk * 60) ** 2 / tau
        x = tau / time
        wander = 2 / x * (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x))
        expected = white + (top / 0.6174) ** 2 * wander
        np.testing.assert_allclose(allan_variance(rates, samples), expected, rtol=0.12)
    x = 1.89  # where the process's Allan deviation is at its top
    wander = 2 / x * (1 - (3 - 4 * np.exp(-x) + np.exp(-2 * x)) / (2 * x))
    np.testing.assert_allclose(np.sqrt(wander), 0.6174, atol=1e-3)


def test_the_observation_is_what_is_measured():
    """Eq. 11 of the told attitude and rate; the reward and the outcome are of the truth."""
    table = {"star_tracker": {"cross_boresight_arcsec": 2e4, "roll_arcsec": 2e4}}
    env = AttitudeEnv(5, world=sensing(**table))
    params = env.default_params
    observation, state = env.reset(jax.random.key(0), params)
    for _ in range(3):
        observation, state, _, _, info = env.step_env(jax.random.key(0), state, 1, params)
        told = measured(state)
        np.testing.assert_array_equal(observation[:4], told.quaternion)
        assert np.abs(told.quaternion - state.quaternion).max() > 1e-3
        true = np.rad2deg(Rotation.from_quat(state.quaternion).magnitude())
        shown = float(info["outcome"]["terminal_error_deg"])
        assert min(abs(shown - true), abs(360 - shown - true)) < 1e-2


NOISY = {
    "gyro": {"angle_random_walk_deg_per_root_h": 0.1},
    "star_tracker": {"cross_boresight_arcsec": 5, "rate_hz": 4},
}


def told_rate(rate, **sensors):
    """What a gyro says of it an agent step later."""
    env = AttitudeEnv(5, world=sensing(**sensors))
    params = env.default_params
    state = env.reset(jax.random.key(0), params)[1].replace(angular_velocity=rate)
    return measured(env.step_env(jax.random.key(0), state, 1, params)[1]).angular_velocity


def test_a_sensors_noise_does_not_change_with_what_else_a_world_has():
    alone, among = (told_rate(jnp.zeros(3), **x) for x in ({"gyro": NOISY["gyro"]}, NOISY))
    np.testing.assert_array_equal(alone, among)


def test_derivatives_pass_through_sensors():
    slope = jax.jacfwd(lambda rate: told_rate(rate, **NOISY))(jnp.zeros(3))
    np.testing.assert_allclose(slope, np.eye(3), atol=0.01)


@pytest.mark.parametrize("platform", ["cpu", "cuda"])
def test_sensors_are_lowered_for_each_device(platform):
    step = jax.jit(jax.vmap(lambda rate: told_rate(rate, **NOISY))).trace(jnp.zeros((4, 3)))
    assert step.lower(lowering_platforms=(platform,)).as_text()
