"""Kinematics with another factor than Eq. 9's ½, as in the authors' public code."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, random_spacecraft, rotated_inertia
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from attjax import dynamics
from attjax.dynamics import propagation, quaternion
from attjax.dynamics.integration import AgentStep

pytestmark = pytest.mark.usefixtures("strict_promotion")
BODIES = pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])


def integrate(start, steps, dt, factor, inertia=LM50):
    """``steps`` calls of rk4_step without torque."""

    def body(_, state):
        return dynamics.rk4_step(*state, jnp.zeros(3), jnp.asarray(inertia), dt, factor)

    state = (jnp.asarray(start[:4]), jnp.asarray(start[4:]))
    return np.concatenate(jax.lax.fori_loop(0, steps, body, state))


def reference(start, duration, factor, torque, inertia=LM50):
    """DOP853 on Euler's equations and q̇ = factor q∘[ω, 0], written with vectors."""
    tensor = np.diag(inertia) if np.ndim(inertia) == 1 else np.asarray(inertia)

    def rate(_, y):
        v, s, w = y[:3], y[3], y[4:]
        turning = np.linalg.solve(tensor, torque - np.cross(w, tensor @ w))
        return [*(factor * (s * w + np.cross(v, w))), -factor * v @ w, *turning]

    return solve_ivp(rate, (0, duration), start, "DOP853", rtol=1e-13, atol=1e-15).y[:, -1]


@pytest.mark.parametrize("factor", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("axis", range(3))
def test_spin_about_a_principal_axis_turns_by_twice_the_factor(x64, factor, axis):
    """Angle = 2 factor ω t, about any start, against SciPy's rotations."""
    first = Rotation.from_rotvec([0.3, -0.2, 0.5])
    rate, duration = 0.3 * np.eye(3)[axis], 3.0
    ours = integrate(np.array([*first.as_quat(), *rate]), 720, 1 / 240, factor)
    expected = (first * Rotation.from_rotvec(2 * factor * duration * rate)).as_quat()
    np.testing.assert_allclose(ours[:4], expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(ours[4:], rate)


def test_order_of_convergence_is_four(x64):
    q, w, _ = (np.asarray(x[0]) for x in random_spacecraft(1))
    start = np.array([*q, *w])
    expected = reference(start, 2.0, 1.0, np.zeros(3))
    steps = np.array([20, 40, 80, 160])
    errors = [np.abs(integrate(start, n, 2.0 / n, 1.0) - expected).max() for n in steps]
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.1)


@BODIES
@pytest.mark.parametrize("held", [False, True])
def test_an_agent_step_of_other_kinematics(x64, inertia, held):
    """Pulse and coast, all of the steps and some of them, against DOP853."""
    moving = random_spacecraft(3)
    for steps_after in (None, jnp.full(3, 4.0)):

        def take(q, w, torque, steps):
            return propagation.take(
                AgentStep(7, held, 1.0), q, w, torque, jnp.asarray(inertia), steps
            )

        axes = (0, 0, 0, None if steps_after is None else 0)
        ours = np.hstack(jax.jit(jax.vmap(take, axes))(*moving, steps_after))
        later = 7 if steps_after is None else 4
        for row, (q, w, torque) in enumerate(zip(*map(np.asarray, moving))):
            expected = reference(np.array([*q, *w]), 1 / 240, 1.0, torque, inertia)
            expected = reference(expected, later / 240, 1.0, torque * held, inertia)
            np.testing.assert_allclose(ours[row], expected, rtol=0, atol=1e-12)


@BODIES
def test_eq_9_is_what_is_traced_by_default(monkeypatch, inertia):
    """The very operations of the kinematics with a ½ and no factor, written out here."""
    q, w, torque = (x[0] for x in random_spacecraft(1))

    def traced():
        def agent_step(q, w, torque):
            return dynamics.propagate(q, w, torque, jnp.asarray(inertia), 5)

        return str(jax.make_jaxpr(agent_step)(q, w, torque).jaxpr)

    def eq_9(quaternion, angular_velocity, factor):
        assert factor == 0.5
        (q1, q2, q3, qs), (w1, w2, w3) = quaternion, angular_velocity
        return (
            0.5 * (w3 * q2 - w2 * q3 + w1 * qs),
            0.5 * (w1 * q3 - w3 * q1 + w2 * qs),
            0.5 * (w2 * q1 - w1 * q2 + w3 * qs),
            -0.5 * (w1 * q1 + w2 * q2 + w3 * q3),
        )

    ours = traced()
    monkeypatch.setattr(quaternion, "derivative", eq_9)
    assert ours == traced()
