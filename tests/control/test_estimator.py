"""The filter: first-order errors against derivatives, and its own account of them over flights."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from consistency import flown
from worlds import world

from attjax import AttitudeEnv, Spacecraft, World
from attjax.control import belief, covariance, estimator, linearized, measured
from attjax.control.classical import phase_plane
from attjax.control.flight_loop import flight_loop
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics import vectors
from attjax.dynamics.sensing import Measurement
from attjax.world import Actuators, made_for, names

TENSOR = ((0.9, 0.02, 0.01), (0.02, 0.5, -0.03), (0.01, -0.03, 0.8))
CRAFTS = {
    "pulses, principal axes": Spacecraft(),
    "held, full tensor": Spacecraft(inertia=TENSOR, torque_levels=(0.05,), torque_held=True),
}
WHEELS = {"wheels": {"inertia": 1e-3, "start_speed": 50, "viscous_friction": 1e-5}}
TOLD = {
    "star_tracker": {"rate_hz": 10, "latency": 0.02, "cross_boresight_arcsec": 5},
    "gyro": {"rate_hz": 60, "bias_deg_per_h": 100},
}


def believing(craft, **tables):
    """Environment, context, and an estimate and what is expected after a while, in float64."""
    disturbed = {"constant_torque": 1e-3}
    described = world(sensors=TOLD, disturbances=disturbed, **tables)
    env = AttitudeEnv(10, spacecraft=CRAFTS[craft], world=described)
    context = env.context(env.default_params)
    memory = flight_loop(phase_plane).init(context)
    known = memory.estimate.replace(
        quaternion=tuple(quaternions.normalize(jnp.array([0.2, -0.3, 0.4, 0.8]))),
        angular_velocity=tuple(jnp.array([0.3, -0.2, 0.25])),
        bias=tuple(jnp.array([1e-3, -2e-3, 5e-4])),
        torque=tuple(jnp.array([1e-3, -2e-3, 5e-4])),
    )
    if known.wheel_speeds is not None:
        known = known.replace(wheel_speeds=tuple(jnp.array([50.0, -80.0, 20.0])))
    return context, known, memory.replace(queue=memory.queue.and_then(0, jnp.array([0.01] * 3)))


def moved(estimate, error):
    """The estimate that is wrong by an error (θ, Δω, Δb, Δd)."""
    parts = [tuple(error[n : n + 3]) for n in range(0, 12, 3)]
    return estimate.replace(
        quaternion=quaternions.turned(estimate.quaternion, parts[0]),
        angular_velocity=vectors.add(estimate.angular_velocity, parts[1]),
        bias=vectors.add(estimate.bias, parts[2]),
        torque=vectors.add(estimate.torque, parts[3]),
    )


@pytest.mark.parametrize("craft", CRAFTS)
@pytest.mark.parametrize("aboard", [{}, {"actuators": WHEELS}])
def test_errors_grow_as_the_derivatives_of_the_motion_say(craft, aboard):
    """F P Fᵀ of a control period, F by differentiating the believed motion itself."""
    with jax.enable_x64(True):
        context, known, memory = believing(craft, **aboard)

        def end(error):
            wrong = moved(known, error)
            motion = belief.one_period(wrong, memory.queue, jnp.asarray(0), context)
            turn = vectors.then(vectors.conjugate(right.quaternion), motion.quaternion)
            rates = vectors.add(motion.angular_velocity, (0.0, 0.0, 0.0))
            return jnp.stack([*(2 * x for x in turn[:3]), *rates, *wrong.bias, *wrong.torque])

        right = belief.one_period(known, memory.queue, jnp.asarray(0), context)
        growth = np.asarray(jax.jacfwd(end)(jnp.zeros(12)))
        scales = np.repeat([1e-3, 1e-3, 1e-4, 1e-3], 3)
        root = np.random.default_rng(0).normal(size=(12, 12)) * scales[:, None]
        spread = covariance.triangle(12, lambda i, j: jnp.asarray((root @ root.T)[i, j]))
        model = linearized.model(memory.queue, context)
        after = linearized.covariance_after(known.replace(covariance=spread), right, model)
        found = [[float(covariance.at(after, i, j)) for j in range(12)] for i in range(12)]
    wanted = growth @ root @ root.T @ growth.T
    sizes = np.sqrt(np.diag(wanted))
    correlations = wanted / np.outer(sizes, sizes)
    np.testing.assert_allclose(found / np.outer(sizes, sizes), correlations, rtol=0, atol=5e-3)


@pytest.mark.parametrize("craft", CRAFTS)
def test_what_sensors_say_of_an_error_is_as_their_rows_have_it(craft):
    """Of a gyro and a late star tracker that have sampled between two decisions."""
    with jax.enable_x64(True):
        context, known, memory = believing(craft)
        rng = np.random.default_rng(1)
        error = rng.normal(size=12) * np.repeat([1e-5, 1e-5, 1e-6, 0], 3)
        time, two = jnp.asarray(2), []
        for start in (known, moved(known, jnp.asarray(error))):
            level = memory.expected
            two.append(estimator.predicted(start, level, memory.queue, time, context))
        (ours, expected), (true, seen) = two
        told = estimator.told_by(flight_measurement(true, seen), context)
        numbers = measured.innovations(ours, expected, told, linearized.noise(context))
        turn = vectors.then(vectors.conjugate(ours.quaternion), true.quaternion)
        late = [2 * x for x in turn[:3]]
        late += [x - y for x, y in zip(true.angular_velocity, ours.angular_velocity)]
        late += [x - y for x, y in zip(true.bias, ours.bias)] + [0.0] * 3
        rows = np.array([[0.0 if x is None else float(x) for x in n.row] for n in numbers])
        found = np.array([float(n.innovation) for n in numbers])
    assert float(expected.age) == pytest.approx(9 / 240)  # of the sample 24 of 33 RK4 steps on
    np.testing.assert_allclose(found, rows @ np.array(late, float), rtol=0, atol=3e-7)
    assert np.min(np.abs(found)) > 1e-6


def flight_measurement(true, seen):
    """What perfect sensors say of a true state, with its bias."""
    then = vectors.then(true.quaternion, vectors.conjugate(seen.turn))
    rate = vectors.add(seen.rate, true.bias)
    return Measurement(jnp.stack(then), True, jnp.stack(rate), True)


@pytest.mark.parametrize(
    "disturbances",
    [
        {"flexible": {"frequency": 1, "participation": 0.1}},
        {"gravity_gradient": True},
        {"gravity_gradient": True, "constant_torque": 1e-4},
    ],
)
def test_where_nothing_turns_a_body_at_rest_all_is_finite(disturbances):
    """A flexible mode alone, and the pull of gravity at a sphere: there is nothing to divide by."""
    sphere = Spacecraft(inertia=(0.5, 0.5, 0.5), duration=2.0)
    described = world(sensors={"star_tracker": {"rate_hz": 4}}, disturbances=disturbances)
    env = AttitudeEnv(5, spacecraft=sphere, world=described)
    errors, _ = flown(env, lambda told, context: jnp.asarray(0), 3, 40)
    assert np.all(np.isfinite(errors))


def exact(name):
    """A named world whose torques, inertia and gyro are as believed; the rest as it is."""
    named = World.named(name)
    gyro = dataclasses.replace(named.sensors.gyro, scale_factor_ppm=0, misalignment_arcsec=0)
    return dataclasses.replace(
        named,
        name="exact",
        uncertainty=None,
        actuators=Actuators(wheels=named.wheels),
        sensors=dataclasses.replace(named.sensors, gyro=gyro),
    ), made_for(named)


@pytest.mark.parametrize("name", names()[1:])
def test_its_errors_are_as_large_as_it_says_where_noise_is_all_that_is_wrong(name):
    """NEES and NIS over 1,000 flights: χ² of 3,000 degrees of freedom is within 0.9 and 1.1."""
    described, spacecraft = exact(name)
    env = AttitudeEnv(5, spacecraft=spacecraft, world=described)
    errors, innovations = flown(
        env, phase_plane, 1000, int(env.default_params.max_steps_in_episode)
    )
    late = errors[[1, 20, 80, len(errors) // 2, -1]]
    assert late.min() > 0.8 and late.max() < 1.15
    assert np.nanmean(innovations, axis=0) == pytest.approx([1, 1], abs=0.04)


@pytest.mark.parametrize("name", ["lm50-leo", "cubesat-6u"])
def test_and_no_larger_where_torques_and_inertia_are_wrong(name):
    """It takes what is wrong by the same share all the time for noise, and is careful in that."""
    spacecraft, described = made_for(World.named(name)), World.named(name)
    env = AttitudeEnv(5, spacecraft=spacecraft, world=described)
    errors, innovations = flown(env, phase_plane, 1000, 800)
    assert errors.min() > 0.3 and errors.max() < 1.3
    assert np.nanmax(innovations) < 1.3
