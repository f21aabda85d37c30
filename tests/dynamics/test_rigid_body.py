import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, rotated_inertia
from scipy.integrate import solve_ivp

from attjax.dynamics import rigid_body

pytestmark = pytest.mark.usefixtures("strict_promotion")


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
def test_peak_rate_is_the_largest_of_a_long_coast(x64, inertia):
    rng = np.random.default_rng(4)
    for _ in range(5):
        w = rng.normal(size=3)
        w *= 0.4 / np.linalg.norm(w)
        tensor = np.diag(inertia) if np.ndim(inertia) == 1 else inertia
        coast = solve_ivp(
            lambda _, w, tensor=tensor: np.linalg.solve(tensor, -np.cross(w, tensor @ w)),
            (0, 300), w, "DOP853", t_eval=np.arange(0, 300, 0.02), rtol=1e-11, atol=1e-13,
        )  # fmt: skip
        rates = np.linalg.norm(coast.y, axis=0)
        peak = float(rigid_body.peak_rate(jnp.asarray(w), jnp.asarray(inertia)))
        assert rates.max() <= peak * (1 + 1e-8)
        assert peak == pytest.approx(rates.max(), rel=1e-5)


def test_peak_rate_of_steady_spins_and_of_a_sphere():
    inertia = jnp.array(LM50)
    spins = 0.3 * jnp.eye(3)
    expected = [0.3, 0.3, 0.3 * np.sqrt(0.797 * (0.872 + 0.115 - 0.797) / (0.872 * 0.115))]
    np.testing.assert_allclose(rigid_body.peak_rate(spins, inertia), expected, rtol=1e-6)
    np.testing.assert_allclose(rigid_body.peak_rate(spins, jnp.full(3, 0.4)), 0.3, rtol=1e-6)


def test_peak_rate_of_a_batch_is_that_of_each(x64):
    """The three spins at unlike rates, as the rows of one array, with a full tensor."""
    moments, rotation = np.array([0.2, 0.3, 0.4]), np.linalg.qr(np.arange(9).reshape(3, 3) ** 2)[0]
    inertia = rotation @ np.diag(moments) @ rotation.T
    # About the intermediate axis ω² grows by I₂(I₁ + I₃ − I₂)/(I₁I₃) = 9/8.
    spins = np.array([[0.1], [0.2], [0.3]]) * rotation.T
    expected = [0.1, 0.2 * np.sqrt(9 / 8), 0.3]
    np.testing.assert_allclose(rigid_body.peak_rate(spins, jnp.asarray(inertia)), expected)


def test_inverse_momentum_and_moments_agree_with_numpy(x64):
    inertia = rotated_inertia()
    rates = np.random.default_rng(0).normal(size=(4, 3))
    np.testing.assert_allclose(rigid_body.inverse(jnp.asarray(inertia)), np.linalg.inv(inertia))
    momenta = rigid_body.angular_momentum(jnp.asarray(inertia), rates)
    np.testing.assert_allclose(momenta, [inertia @ w for w in rates])
    np.testing.assert_allclose(rigid_body.angular_momentum(jnp.asarray(LM50), rates), LM50 * rates)
    moments = rigid_body.principal_moments(jnp.asarray(inertia))
    np.testing.assert_allclose(moments, np.sort(LM50))
    np.testing.assert_array_equal(rigid_body.principal_moments(jnp.asarray(LM50)), LM50)


def test_most_turning_is_that_of_a_flat_body(x64):
    """Its rate halfway between the axes of the least and of the largest moment."""
    inertia = np.array([1e-3, 0.999, 1.0])
    rate = np.array([1, 0, 1]) / np.sqrt(2)
    form = np.asarray(rigid_body.peak_rate_form(jnp.asarray(inertia)))
    assert rate @ form @ rate == pytest.approx(1)
    turning = np.cross(rate, inertia * rate) / inertia
    assert np.sqrt(turning @ form @ turning) == pytest.approx(rigid_body.MOST_TURNING, rel=1e-3)
