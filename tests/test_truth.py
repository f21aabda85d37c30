"""Whole flights against Basilisk, DOP853, Jacobi's closed form and physics' balances.

Tolerances are three to ten times what was measured, which stands beside them.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, rotated_inertia
from references import START, assert_same_attitude, basilisk, quaternions_of, reference
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk

import attjax
from attjax import dynamics, spacecraft
from attjax.dynamics import quaternion
from attjax.envs import parameters

pytestmark = pytest.mark.usefixtures("strict_promotion")

TORQUE_TABLE = np.array(spacecraft.LM50.torque_table)
BODIES = (LM50, rotated_inertia())
BOTH_BODIES = pytest.mark.parametrize("inertia", BODIES, ids=["diagonal", "full"])


def random_actions(frameskip, *shape):
    """Actions of whole episodes, (steps, *shape)."""
    steps = spacecraft.LM50.max_steps(frameskip)
    return np.random.default_rng(1).integers(0, len(TORQUE_TABLE), (steps, *shape))


def flight(start, actions, inertia, frameskip):
    """States (1 + steps, 7) before and after each agent step."""
    params = parameters.default_params(frameskip).replace(inertia=jnp.asarray(inertia, float))

    def step(state, action):
        state = attjax.step(state, action, params, frameskip)
        return state, jnp.concatenate([state.quaternion, state.angular_velocity])

    start = jnp.asarray(start, float)
    state = attjax.EnvState(start[:4], start[4:], jnp.array(0))
    return jnp.vstack([start, jax.lax.scan(step, state, jnp.asarray(actions))[1]])


@pytest.mark.parametrize("body", [0, 1], ids=["diagonal", "full"])
def test_flies_as_basilisk(x64, body):
    """100 actions of 21 RK4 steps, in which its attitude switches to the shadow set and back.

    It integrates modified Rodrigues parameters, so that the attitudes agree to the schemes'
    truncation, 4e-13 each by DOP853. The rates obey the same equations in the same steps.
    """
    torques, mrp, expected_rates = np.split(basilisk("slew", body), 3, axis=1)
    inertia = jnp.asarray(BODIES[body])
    dt = 4_166_667e-9  # Basilisk's time is a whole number of nanoseconds

    def agent_step(state, torque):
        def coast(_, state):
            return dynamics.rk4_step(*state, jnp.zeros(3), inertia, dt)

        pulse = dynamics.rk4_step(*state, torque, inertia, dt)
        q, w = jax.lax.fori_loop(0, 20, coast, pulse)
        state = (quaternion.normalize(q), w)
        return state, state

    expected = quaternions_of(mrp)
    start = (jnp.asarray(expected[0]), jnp.asarray(expected_rates[0]))
    _, (q, w) = jax.lax.scan(agent_step, start, jnp.asarray(torques[1:]))
    # 1.5e-16 and 2.1e-13; compilers that contract products and sums otherwise round otherwise.
    np.testing.assert_allclose(w, expected_rates[1:], rtol=0, atol=1e-13)
    assert_same_attitude(q, expected[1:], 1e-12)


@BOTH_BODIES
def test_an_episode_agrees_with_dop853(x64, inertia):
    """43.75 s, 500 random actions, each pulse and each coast integrated apart."""
    actions, exact = random_actions(20), START
    for torque in TORQUE_TABLE[actions]:
        exact = reference(reference(exact, 1 / 240, torque, inertia), 20 / 240, inertia=inertia)
    ours = flight(START, actions, inertia, 20)[-1]
    np.testing.assert_allclose(ours[:4], exact[:4], rtol=0, atol=1e-11)  # 1.4e-12
    np.testing.assert_allclose(ours[4:], exact[4:], rtol=0, atol=2e-12)  # 3.7e-13


@pytest.mark.parametrize("a", [0, 1], ids=["pushed_about_the_largest", "about_the_least"])
def test_spin_about_the_intermediate_axis_flips_as_in_the_closed_form(x64, a):
    """One period of it, over a minute, pushed about one of the other axes.

    With b the intermediate axis, a the one that is pushed and c the third, ω_a ∝ dn, ω_b ∝ sn
    and ω_c ∝ cn of u = K + p t, and the period is 4 K/p (Landau and Lifshitz, Mechanics, § 37).
    """
    b, c = 2, 1 - a
    start = np.zeros(3)
    start[a], start[b] = 0.01, 0.4
    ia, ib, ic = LM50[[a, b, c]]
    twice_energy, momentum_squared = LM50 @ start**2, LM50**2 @ start**2
    over, under = momentum_squared - twice_energy * ic, twice_energy * ia - momentum_squared
    p = np.sqrt((ia - ib) * over / (ia * ib * ic))
    m = (ib - ic) * under / ((ia - ib) * over)
    period = 4 * ellipk(m) / p
    steps = round(240 * period)
    dt = period / steps

    def step(state, _):
        state = dynamics.rk4_step(*state, jnp.zeros(3), jnp.asarray(LM50), dt)
        return state, state[1]

    state = (jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.asarray(start))
    rates = np.vstack([start, jax.lax.scan(step, state, length=steps)[1]])[:, [a, b, c]]

    sn, cn, dn, _ = ellipj(ellipk(m) + p * dt * np.arange(steps + 1), m)
    scale = [over / (ia * (ia - ic)), under / (ib * (ia - ib)), under / (ic * (ia - ic))]
    expected = np.sqrt(scale) * np.stack([dn, sn, cn], axis=1)
    np.testing.assert_allclose(rates, expected, rtol=0, atol=1e-11)  # 3.1e-12

    about_b = rates[:, 1]
    last = np.flatnonzero(np.diff(np.sign(about_b)))  # before ω_b passes through zero
    down, up = last + about_b[last] / (about_b[last] - about_b[last + 1])
    assert (up - down) * dt == pytest.approx(period / 2, rel=5e-12)  # 7.5e-13


@BOTH_BODIES
def test_torque_accounts_for_energy_and_inertial_momentum(x64, inertia):
    """ΔT = ∫ ω·M dt and ΔH = ∫ R M dt over an episode, by Simpson's rule over each pulse."""
    tensor = np.diag(inertia) if inertia.ndim == 1 else inertia
    actions = random_actions(20)
    torques = TORQUE_TABLE[actions]
    states = np.asarray(flight(START, actions, inertia, 20))
    before = [jnp.asarray(x) for x in (states[:-1, :4], states[:-1, 4:], torques, inertia)]
    later = jax.vmap(dynamics.rk4_step, (0, 0, 0, None, None))
    pulse = [states[:-1], *(np.hstack(later(*before, dt)) for dt in (1 / 480, 1 / 240))]
    simpson = np.array([1, 4, 1]) / 6 / 240

    power = [np.sum(y[:, 4:] * torques, axis=1) for y in pulse]
    work = np.cumsum(np.tensordot(simpson, power, 1))
    energy = np.sum(states[:, 4:] @ tensor * states[:, 4:], axis=1) / 2
    np.testing.assert_allclose(energy[1:] - energy[0], work, rtol=0, atol=1e-13)  # 2.1e-14

    turned = [Rotation.from_quat(y[:, :4]).apply(torques) for y in pulse]
    impulse = np.cumsum(np.tensordot(simpson, turned, 1), axis=0)
    momentum = Rotation.from_quat(states[:, :4]).apply(states[:, 4:] @ tensor)
    np.testing.assert_allclose(momentum[1:] - momentum[0], impulse, rtol=0, atol=5e-13)  # 7.6e-14


@pytest.mark.parametrize("frameskip", [5, 20])
def test_float32_error_stays_below_the_root_of_time(frameskip):
    """100 whole episodes of random actions, against bounds that grow as √(agent steps).

    Rounding errors that add up at random would grow so; errors of the rate that turn into
    angle grow faster, which the measured factors, the largest of the episode, take in.
    """
    start = np.hstack([Rotation.random(100, rng=2).as_quat(), np.zeros((100, 3))])
    start, actions = start.astype(np.float32), random_actions(frameskip, 100)
    fly = jax.vmap(flight, (0, 1, None, None))
    single = np.asarray(fly(start, actions, LM50, frameskip), np.float64)[:, 1:]
    with jax.enable_x64(True):
        double = np.asarray(fly(start, actions, LM50, frameskip))[:, 1:]
    turns = [Rotation.from_quat(x[..., :4].reshape(-1, 4)) for x in (single, double)]
    angle = (turns[0].inv() * turns[1]).magnitude().reshape(double.shape[:2])
    rate = np.linalg.norm(single[..., 4:] - double[..., 4:], axis=-1)
    angle, rate = (error / np.sqrt(np.arange(1, len(actions) + 1)) for error in (angle, rate))

    def rms(error):
        return np.sqrt(np.mean(error**2, axis=0)).max()

    assert rms(angle) <= 4e-7 and angle.max() <= 1.2e-6  # 1.1e-7 and 3.9e-7 rad
    assert rms(rate) <= 2e-8 and rate.max() <= 1e-7  # 5.4e-9 and 2.7e-8 rad/s
    length = np.linalg.norm(single[..., :4], axis=-1)
    np.testing.assert_allclose(length, 1, rtol=0, atol=3e-7)  # 1.0e-7; not normalised: 1e-6


def test_gradient_through_an_episode_is_that_of_finite_differences(x64):
    """500 agent steps of any torques, along eight random directions in their space."""
    rng = np.random.default_rng(3)
    torques, inertia = jnp.asarray(rng.uniform(-0.2, 0.2, (500, 3))), jnp.asarray(LM50)
    directions = jnp.asarray(rng.normal(size=(8, 500, 3)))

    def miss(torques):
        def step(state, torque):
            return dynamics.propagate(*state, torque, inertia, 20), None

        start = (jnp.asarray(START[:4]), jnp.asarray(START[4:]))
        q, w = jax.lax.scan(step, start, torques)[0]
        return jnp.sum(q[:3] ** 2) + jnp.sum(w**2)

    h = 1e-6  # N m; truncation of the differences and rounding are then about equal
    ahead, behind = jax.vmap(jax.vmap(miss))(torques + h * jnp.stack([directions, -directions]))
    along = np.tensordot(directions, jax.grad(miss)(torques), 2)
    np.testing.assert_allclose((ahead - behind) / (2 * h), along, rtol=2e-7)  # 3e-9 to 3e-8
