import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv
from attjax.control import features
from attjax.envs import observation

pytestmark = pytest.mark.usefixtures("strict_promotion")

ENV = AttitudeEnv(frameskip=5)
CONTEXT = ENV.context(ENV.default_params)


def observe(angular_velocity, quaternion=(0.0, 0.0, 0.0, 1.0)):
    return observation.observe(jnp.array(quaternion), jnp.array(angular_velocity, float))


def test_multiscale_features_resolve_every_decade():
    """A change of 1 % at any distance from the goal moves some feature by 1e-3 or more."""
    for magnitude in 10.0 ** np.arange(-6, 0):
        a = features.multiscale_features(observe([magnitude, 0, 0]), CONTEXT)
        b = features.multiscale_features(observe([1.01 * magnitude, 0, 0]), CONTEXT)
        assert a.shape == (57,)
        assert float(jnp.abs(a - b).max()) > (1e-3 if magnitude > 1e-5 else 1e-4)
        assert float(jnp.abs(a).max()) <= 3


def test_multiscale_features_make_the_last_stretch_the_same_at_every_rate():
    """Half the period at half the distance: the same ω brings it there in as many actions."""
    rate = [2e-5, -1e-5, 3e-5]
    contexts = [CONTEXT.replace(control_period=jnp.array(x)) for x in (0.0875, 0.04375)]
    slow = features.multiscale_features(observe(rate, (2e-5, 4e-5, -6e-5, 1.0)), contexts[0])
    fast = features.multiscale_features(observe(rate, (1e-5, 2e-5, -3e-5, 1.0)), contexts[1])
    np.testing.assert_allclose(slow[:-2], fast[:-2], rtol=1e-6)


@pytest.mark.parametrize("period", [0.1, 0.025])
def test_multiscale_features_written_out(x64, period):
    """tanh(4ⁿ x) scale by scale, then q_s, the period in 0.1 s and its logarithm."""
    context = CONTEXT.replace(control_period=jnp.array(period))
    q, w = np.array([0.3, -2e-3, 4e-6, 0.9]), np.array([0.2, -1e-4, 3e-7])
    x = np.concatenate([q[:3] * 0.05 / period, w])
    expected = [np.tanh(4.0**n * component) for n in range(9) for component in x]
    expected += [q[3], period / 0.1, np.log(period / 0.1)]
    observed = jnp.concatenate([q, np.full(4, 7.0), w])  # q̇ is not looked at
    np.testing.assert_allclose(features.multiscale_features(observed, context), expected)


def test_an_observation_of_another_size_is_refused(as_users_run):
    wrong = r"observation has shape \(10,\); it must be \(11,\)"
    with pytest.raises(ValueError, match=wrong):
        features.multiscale_features(observe([0, 0, 0])[:10], CONTEXT)
