"""From action to torque and from state to observation there is one way: all that flies goes it."""

import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from own_environment import BIAS, BRAKE, Weak
from pages import embedded

import attjax
from attjax import AttitudeEnv, EnvState, Spacecraft, evaluation
from attjax.envs import torques
from attjax.evaluation import plots
from attjax.evaluation.playback import page as playback
from attjax.export import flight_check

pytestmark = pytest.mark.usefixtures("strict_promotion")

PUSH = jax.tree_util.Partial(lambda observation, context: jnp.array(7))  # 0.05 N m about x


def test_all_see_the_torque_that_one_function_gives(monkeypatch):
    """Of actuators of half the strength."""
    given = torques.applied_torque
    monkeypatch.setattr(torques, "applied_torque", lambda *args: given(*args) / 2)
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

    start = jax.tree.map(lambda x: x[None], start)
    history = evaluation.record(PUSH, env, params, jax.random.key(0), start, 8)
    np.testing.assert_allclose(history.angular_velocity[-1], [[8 * kick, 0, 0]], rtol=1e-5)
    np.testing.assert_allclose(history.torque, np.tile([0.025, 0, 0], (8, 1, 1)), rtol=1e-6)


STEPS = 30
SHORT = Spacecraft(duration=STEPS * 21 / 240)


def braking():
    """(steps,) rate about x and torque, from rest, of a law that is told of a rate of BIAS."""
    kick = 0.25 / 240 / 0.872
    rates, torques = [0.0], []
    for _ in range(STEPS):
        torques.append(-0.25 if rates[-1] + BIAS > 0 else 0.25)
        rates.append(rates[-1] + np.sign(torques[-1]) * kick)
    assert rates[9] == min(rates) < -BIAS < rates[8]  # then to and fro
    return np.array(rates[1:]), np.array(torques)


def test_records_figures_pages_and_vectors_fly_what_the_environment_does(monkeypatch):
    """In the perfect world a spacecraft at rest is told so, and stays at rest."""
    env = Weak(20, spacecraft=SHORT)
    params, (rates, torques) = env.default_params, braking()
    flight = plots.Flight(BRAKE, env, params, 0, episodes=1)
    _, history = flight.table_5
    page = embedded(playback.page({"brake": BRAKE}, env, params, 0))["flights"][:, 0]
    for slew in range(3):
        rate, torque = history.angular_velocity[:, slew], history.torque[:, slew]
        for found, expected in ((rate, rates), (torque, torques)):
            np.testing.assert_allclose(found[:, 0], expected, rtol=1e-4)
        np.testing.assert_allclose(page[slew, 1:, 4], rates, rtol=1e-4)
        np.testing.assert_allclose(page[slew, :-1, 7], torques)

    exported = types.SimpleNamespace(
        env=env,
        act=BRAKE,
        act_in_float32=BRAKE,
        context=env.context(params),
        torque_table=params.torque_table,
    )
    monkeypatch.setattr(flight_check, "decisions", lambda flight, quaternion, rate: rate)
    seen = flight_check.flown_decisions(exported, 0, slews=2, states_per_slew=STEPS)
    np.testing.assert_allclose(seen[::2, 0], rates, rtol=1e-4)
    end = flight_check.fly_table_5(exported).rate
    np.testing.assert_allclose(end, np.abs(rates[-1]), rtol=1e-4)
