import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, rotated_inertia

from attjax import AttitudeEnv, dynamics
from attjax.control import assurance
from attjax.dynamics import rigid_body
from attjax.envs import initial_state, simulator

pytestmark = pytest.mark.usefixtures("strict_promotion")

ENV = AttitudeEnv(frameskip=5)
CONTEXT = ENV.context(ENV.default_params)


@pytest.mark.parametrize("duration", [1 / 240, 0.1], ids=["pulse", "held"])
def test_mask_removes_exactly_the_actions_that_lead_beyond_the_limit(x64, duration):
    """0.45 rad/s by a forecast of first order, 0.475 by an upper bound."""
    rng = np.random.default_rng(0)
    context = ENV.context(ENV.default_params).replace(torque_duration=duration)
    change = np.asarray(context.torque_table) / np.asarray(context.inertia) * duration
    form = [1, 1, 0.797 * (0.872 + 0.115 - 0.797) / (0.872 * 0.115)]
    growth = np.sqrt(change**2 @ form)
    turning = 0.5**0.5 * duration * growth
    turning = turning * (0.475**2 + 2 / 3 * 0.475 * growth + growth**2 / 6)
    mask, limited = assurance.rate_mask(context, 0.9), 0
    for _ in range(200):
        w = rng.normal(size=3)
        w *= rng.uniform(0.40, 0.52) / np.linalg.norm(w)
        before, after = w**2 @ form, (w + change) ** 2 @ form
        expected = (after <= 0.45**2) & (after + turning <= 0.475**2)
        expected |= (after + turning < before) | (np.arange(19) == 0)
        np.testing.assert_array_equal(mask.allowed(w), expected)
        limited += not expected.all()
    assert limited > 50


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
@pytest.mark.parametrize("duration", [0.003, 0.5], ids=["below", "beyond the middle"])
def test_mask_constants_written_out(x64, inertia, duration):
    """For a spacecraft at rest a weak torque and one that passes the limit at once."""
    torques = np.array([[0.0, 0, 0], [0.5, 0.2, -0.9], [0, -0.3, 0]])
    context = CONTEXT.replace(
        inertia=jnp.asarray(inertia),
        torque_table=jnp.asarray(torques),
        torque_duration=duration,
        rate_limit=jnp.array(0.5),
    )
    tensor = np.diag(inertia) if inertia.ndim == 1 else inertia
    low, _, high = np.sort(LM50)
    form = ((low + high) * tensor - tensor @ tensor) / (low * high)
    change = torques @ np.linalg.inv(tensor) * duration
    growth = np.sqrt(np.einsum("ai,ij,aj->a", change, form, change))
    turning = np.sqrt(1 / 2) * duration * growth
    turning = turning * (0.4**2 + 2 / 3 * 0.4 * growth + growth**2 / 6)
    allowed = np.minimum(0.3**2 + turning, 0.4**2)  # with a margin of 0.6: 0.3, in the middle 0.4
    ours = assurance.rate_mask(context, 0.6)
    expected = assurance.RateMask(form, change, growth**2 + turning, allowed, torques)
    for x, y in zip(jax.tree.leaves(ours), jax.tree.leaves(expected), strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-12, atol=1e-15)
    assert ours.coasts.tolist() == [True, False, False]


def test_mask_at_its_very_edges(x64):
    """A sphere at rest, whose rate a torque held for 0.5 s brings to just what the mask keeps."""
    torques = jnp.array([[0.0, 0, 0], [1.0, 0, 0], [1.0 + 1e-12, 0, 0], [1e-200, 0, 0]])
    context = CONTEXT.replace(
        inertia=jnp.ones(3), torque_table=torques, torque_duration=0.5, rate_limit=jnp.array(1.0)
    )
    mask = assurance.rate_mask(context, 0.5)
    assert mask.allowed(jnp.zeros(3)).tolist() == [1, 1, 0, 1]
    # Beyond the limit, a torque that is lost in rounding lowers nothing.
    assert mask.allowed(jnp.array([0.0, 2, 0])).tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize("frameskip", [0, 5, 20])
@pytest.mark.parametrize("reckless", [True, False], ids=["fastest", "random"])
def test_no_policy_under_the_mask_passes_the_limit(frameskip, reckless):
    """64 spacecraft that spin up as far as the mask lets them, or act at random."""
    env, margin = AttitudeEnv(frameskip), 0.99
    params = env.default_params
    context = env.context(params)
    mask = assurance.rate_mask(context, margin)

    def step(state, key):
        allowed = mask.allowed(state.angular_velocity)
        wish = jax.random.uniform(key, (19,))
        if reckless:
            after = dynamics.rate_after_impulse(
                state.angular_velocity, context.torque_table, context.inertia
            )
            wish = rigid_body.peak_rate(after, context.inertia) + 1e-3 * wish
        state = simulator.step(state, jnp.argmax(jnp.where(allowed, wish, -1.0)), params, frameskip)
        return state, jnp.sqrt(jnp.sum(state.angular_velocity**2))

    def highest_rate(key):
        start = initial_state.initial_state(key, params)
        return jnp.max(jax.lax.scan(step, start, jax.random.split(key, 1750))[1])

    rates = jax.jit(jax.vmap(highest_rate))(jax.random.split(jax.random.key(1), 64))
    assert rates.max() <= margin * params.rate_limit * (1 + 1e-5)
    if reckless:
        assert rates.max() > 0.985 * params.rate_limit
