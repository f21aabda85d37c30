"""Dynamics against SciPy, conservation laws, closed forms and the order of RK4."""

import functools

import chex
import jax
import jax.numpy as jnp
import jax.test_util
import numpy as np
import pytest
from bodies import LM50, random_spacecraft, rotated_inertia
from references import NO_TORQUE, START, reference
from scipy.spatial.transform import Rotation

from attjax import dynamics
from attjax.dynamics import equations, integration
from attjax.dynamics.fused_loop import one_kernel, one_loop

pytestmark = pytest.mark.usefixtures("strict_promotion")


def integrate(start, steps, dt, torque=NO_TORQUE, inertia=LM50):
    """``steps`` calls of rk4_step."""

    def body(_, state):
        return dynamics.rk4_step(*state, jnp.asarray(torque), jnp.asarray(inertia), dt)

    state = (jnp.asarray(start[:4]), jnp.asarray(start[4:]))
    return np.concatenate(jax.lax.fori_loop(0, steps, body, state))


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
@pytest.mark.parametrize("torque", [np.zeros(3), np.array([0.05, -0.005, 0.02])])
def test_agrees_with_dop853(x64, inertia, torque):
    ours = integrate(START, 480, 1 / 240, torque, inertia)
    expected = reference(START, 2.0, torque, inertia)
    np.testing.assert_allclose(ours, expected, atol=1e-10)


def test_order_of_convergence_is_four(x64):
    torque = np.array([0.02, -0.01, 0.03])
    expected = reference(START, 2.0, torque)
    steps = np.array([20, 40, 80, 160])
    errors = [np.abs(integrate(START, n, 2.0 / n, torque) - expected).max() for n in steps]
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
def test_free_rotation_conserves_energy_and_inertial_momentum(x64, inertia):
    matrix = np.diag(inertia) if inertia.ndim == 1 else inertia
    q, w = jnp.asarray(START[:4]), jnp.asarray(START[4:])
    agent_step = jax.jit(dynamics.propagate, static_argnums=4)
    later_q, later_w = q, w
    for _ in range(500):
        later_q, later_w = agent_step(later_q, later_w, jnp.zeros(3), jnp.asarray(inertia), 20)

    def energy(w):
        return float(0.5 * w @ matrix @ w)

    def momentum(q, w):  # in the desired frame, which is inertial
        return Rotation.from_quat(np.asarray(q)).apply(matrix @ np.asarray(w))

    assert energy(later_w) == pytest.approx(energy(w), rel=1e-10)
    np.testing.assert_allclose(momentum(later_q, later_w), momentum(q, w), atol=1e-10)


def test_axisymmetric_body_precesses_as_in_the_closed_form(x64):
    """I1 = I2: ω3 is constant and (ω1, ω2) turns at λ = (I3 − I1) ω3 / I1."""
    inertia = np.array([0.8, 0.8, 0.3])
    w = np.array([0.2, 0.1, 0.4])
    duration = 10.0
    angle = (inertia[2] - inertia[0]) / inertia[0] * w[2] * duration
    expected = [
        w[0] * np.cos(angle) - w[1] * np.sin(angle),
        w[0] * np.sin(angle) + w[1] * np.cos(angle),
        w[2],
    ]
    start = np.array([0, 0, 0, 1, *w])
    np.testing.assert_allclose(
        integrate(start, 2400, 1 / 240, inertia=inertia)[4:], expected, atol=1e-11
    )


def test_spin_about_a_principal_axis_turns_by_rate_times_time(x64):
    rate, duration = 0.3, 5.0
    q = integrate(np.array([0, 0, 0, 1, 0, rate, 0.0]), 1200, 1 / 240)[:4]
    half = rate * duration / 2
    np.testing.assert_allclose(q, [0, np.sin(half), 0, np.cos(half)], atol=1e-13)


def test_rk4_step_does_not_normalise(x64):
    step = jax.jit(dynamics.rk4_step)
    once, _ = step(*map(jnp.asarray, (START[:4], START[4:], np.zeros(3), LM50)), 1.0)
    doubled, _ = step(*map(jnp.asarray, (2 * START[:4], START[4:], np.zeros(3), LM50)), 1.0)
    assert abs(float(jnp.linalg.norm(once)) - 1) > 1e-7
    np.testing.assert_allclose(doubled, 2 * once, rtol=1e-14)


def test_one_normalisation_equals_one_each_step(x64):
    q, w = jnp.asarray(START[:4]), jnp.asarray(START[4:])
    torque, inertia = jnp.array([0.0, 0.5, 0.0]), jnp.asarray(LM50)
    ours, _ = dynamics.propagate(q, w, torque, inertia, 20)
    for index in range(21):
        q, w = dynamics.rk4_step(q, w, torque if index == 0 else jnp.zeros(3), inertia, 1 / 240)
        q = q / jnp.linalg.norm(q)
    np.testing.assert_allclose(ours, q, atol=1e-15)


@pytest.mark.parametrize("frameskip", [0, 1, 5, 20])
def test_propagate_is_an_impulse_and_free_steps(x64, frameskip):
    torque = np.array([0.5, 0.0, 0.0])
    q, w = dynamics.propagate(*map(jnp.asarray, (START[:4], START[4:], torque, LM50)), frameskip)
    expected = (
        reference(reference(START, 1 / 240, torque), frameskip / 240)
        if frameskip
        else (reference(START, 1 / 240, torque))
    )
    np.testing.assert_allclose(np.concatenate([q, w]), expected, atol=1e-11)


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
@pytest.mark.parametrize("frameskip, steps_after", [(0, None), (20, None), (20, 7), (20, 0)])
def test_a_held_torque_lasts_the_whole_agent_step(x64, inertia, frameskip, steps_after):
    torque = np.array([0.02, -0.05, 0.01])
    arguments = [jnp.asarray(x)[None] for x in (START[:4], START[4:], torque)]
    propagate = jax.vmap(lambda *x: dynamics.propagate(*x, inertia, frameskip, steps_after, True))
    ours = np.concatenate([x[0] for x in propagate(*arguments)])
    steps = 1 + (frameskip if steps_after is None else steps_after)
    np.testing.assert_allclose(ours, reference(START, steps / 240, torque, inertia), atol=1e-11)


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
def test_rate_after_impulse_is_the_integrated_one_to_first_order(x64, inertia):
    torques = np.array([[0.5, 0, 0], [0, -0.05, 0], [0, 0, 0]])
    predicted = dynamics.rate_after_impulse(START[4:], jnp.asarray(torques), jnp.asarray(inertia))
    for torque, rate in zip(torques, predicted):
        exact = reference(START, 1 / 240, torque, inertia)[4:]
        np.testing.assert_allclose(rate, exact, atol=2e-3)
        coasted = reference(START, 1 / 240, inertia=inertia)[4:]
        np.testing.assert_allclose(rate - START[4:], exact - coasted, atol=1e-4)


@pytest.mark.parametrize("frameskip", [5, 20])
def test_float32_stays_close_to_float64(frameskip):
    """200 sequences of 500 random actions."""
    rng = np.random.default_rng(0)
    axes = rng.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    half = np.deg2rad(rng.uniform(30, 150, (200, 1))) / 2
    start = np.hstack([axes * np.sin(half), np.cos(half)]).astype(np.float32)
    torques = np.zeros((500, 200, 3), np.float32)
    index = np.meshgrid(range(500), range(200), indexing="ij")
    torques[(*index, rng.integers(0, 3, (500, 200)))] = rng.choice(
        [0.5, -0.5, 0.05, -0.05, 0.005, -0.005, 0.0], (500, 200)
    )

    def history(dtype):
        inertia = jnp.array(LM50, dtype)

        def step(state, torque):
            state = jax.vmap(dynamics.propagate, (0, 0, 0, None, None))(
                *state, torque, inertia, frameskip
            )
            return state, state

        state = (jnp.array(start, dtype), jnp.zeros((200, 3), dtype))
        run = jax.jit(lambda: jax.lax.scan(step, state, jnp.array(torques, dtype))[1])
        return [np.asarray(x, np.float64) for x in run()]

    single = history(jnp.float32)
    with jax.enable_x64(True):
        double = history(jnp.float64)
    q_error, w_error = (np.abs(a - b).max(axis=(0, 2)) for a, b in zip(single, double))
    assert np.median(q_error) <= 2e-6 and q_error.max() <= 1e-5
    assert np.median(w_error) <= 3e-7 and w_error.max() <= 2e-6


def test_wrong_shapes_and_mixed_types_are_refused(as_users_run):
    q, w, torque = jnp.array([0.0, 0, 0, 1]), jnp.zeros(3), jnp.zeros(3)
    inertia = jnp.array(LM50)
    with pytest.raises(ValueError, match=r"quaternion has shape \(3,\); it must be \(4,\)"):
        dynamics.rk4_step(q[:3], w, torque, inertia)
    with pytest.raises(ValueError, match=r"inertia has shape \(3, 2\)"):
        dynamics.rk4_step(q, w, torque, jnp.ones((3, 2)))
    with pytest.raises(ValueError, match="angular_velocity has type float16; it must be float32"):
        dynamics.rk4_step(q, w.astype(jnp.float16), torque, inertia)


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
@pytest.mark.parametrize("kind", [(0, False), (5, False), (5, True), (45, False)])
@pytest.mark.parametrize("call", [one_loop, one_kernel])
def test_the_groups_for_each_device_do_as_the_plain_scan(x64, call, inertia, kind):
    """Up to rounding: the compiler contracts products and sums differently."""
    motion = equations.EquationsOfMotion.of(jnp.asarray(inertia, float), jnp.ones(3))
    quaternion, rate, _ = random_spacecraft(37)
    start = equations.RigidState.of(quaternion.T, rate.T)
    agent_step = integration.AgentStep(*kind)
    in_groups = functools.partial(integration.change_in_groups, call)
    plain, grouped = (
        jax.jit(jax.vmap(functools.partial(change, agent_step), (0, None, None)))(
            start, motion, None
        )
        for change in (integration.change_by_scan, in_groups)
    )
    chex.assert_trees_all_close(grouped, plain, rtol=0, atol=1e-15)


def test_spacecraft_of_several_control_rates_share_a_program(x64):
    """Each takes its own number of torque-free steps, and its gradients know of no others."""
    arguments = random_spacecraft(6)
    steps = jnp.array([0, 1, 5, 7, 19, 20])
    inertia = jnp.asarray(LM50)
    mixed = jax.jit(jax.vmap(dynamics.propagate, (0, 0, 0, None, None, 0)), static_argnums=4)
    q, w = mixed(*arguments, inertia, 20, steps)
    for row, frameskip in enumerate(steps.tolist()):
        expected = dynamics.propagate(*(x[row] for x in arguments), inertia, frameskip)
        np.testing.assert_allclose(q[row], expected[0], rtol=0, atol=1e-15)
        np.testing.assert_allclose(w[row], expected[1], rtol=0, atol=1e-15)

    def rate(torque, inertia, steps, frameskip):
        q, w = arguments[0][0], arguments[1][0]
        return dynamics.propagate(q, w, torque, inertia, frameskip, steps)[1]

    gradient = jax.jacfwd(rate)
    np.testing.assert_allclose(
        gradient(arguments[2][0], inertia, 5, 20),
        gradient(arguments[2][0], inertia, None, 5),
        atol=1e-15,
    )


def test_gradient_through_an_agent_step_is_that_of_finite_differences(x64):
    arguments = [x[0] for x in random_spacecraft(1)]

    def miss(torque, inertia):
        symmetric = inertia if inertia.ndim == 1 else (inertia + inertia.T) / 2
        q, w = dynamics.propagate(*arguments[:2], torque, symmetric, 5)
        return jnp.sum(q[:3] ** 2) + jnp.sum(w**2)

    for inertia in (jnp.asarray(LM50), jnp.asarray(rotated_inertia())):
        jax.test_util.check_grads(miss, (arguments[2], inertia), order=1, modes=("fwd", "rev"))
