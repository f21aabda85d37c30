"""From action to torque there is one way, and all that flies goes it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import attjax
from attjax import AttitudeEnv, EnvState, evaluation, spacecraft

pytestmark = pytest.mark.usefixtures("strict_promotion")

PUSH = jax.tree_util.Partial(lambda observation, context: jnp.array(7))  # 0.05 N m about x


def test_all_see_the_torque_that_one_function_gives(monkeypatch):
    """Of actuators of half the strength."""
    given = spacecraft.applied_torque
    monkeypatch.setattr(spacecraft, "applied_torque", lambda *args: given(*args) / 2)
    env = AttitudeEnv(2, reward=lambda transition: transition.impulse[0])  # no other test flies it
    start = EnvState(jnp.array([0.6, 0.0, 0.0, 0.8]), jnp.zeros(3), jnp.array(0, jnp.int32))
    params = env.default_params.replace(max_steps_in_episode=jnp.array(8, jnp.int32))
    kick = 0.025 / 240 / 0.872
    after = attjax.step(start, 7, params, 2)
    np.testing.assert_allclose(after.angular_velocity, [kick, 0, 0], rtol=1e-5)

    _, after, impulse, _, info = env.step_env(jax.random.key(0), start, 7, params)
    np.testing.assert_allclose(after.angular_velocity, [kick, 0, 0], rtol=1e-5)
    np.testing.assert_allclose(info["torque"], [0.025, 0, 0], rtol=1e-6)
    np.testing.assert_allclose(impulse, 0.025 / 240, rtol=1e-6)

    flown = evaluation.fly(PUSH, env, params, jax.random.key(0), 3)
    np.testing.assert_allclose(flown.terminal_rate, 8 * kick, rtol=1e-5)
    np.testing.assert_allclose(flown.impulse, 8 * 0.025 / 240, rtol=1e-6)

    history = evaluation.record(PUSH, env, params, jax.tree.map(lambda x: x[None], start), 8)
    np.testing.assert_allclose(history.angular_velocity[-1], [[8 * kick, 0, 0]], rtol=1e-5)
    np.testing.assert_allclose(history.torque, np.tile([0.025, 0, 0], (8, 1, 1)), rtol=1e-6)
