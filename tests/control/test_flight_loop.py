"""The flight loop: nothing in a perfect world, exact where only a known delay is wrong."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from worlds import world

import attjax
from attjax import AttitudeEnv, Spacecraft, evaluation, flight_loop
from attjax.control import belief
from attjax.control.classical import phase_plane, quaternion_feedback
from attjax.control.flight_loop import FlightLoop
from attjax.envs.parameters import measured

WHEELED = Spacecraft(
    inertia=((0.9, 0.02, 0.01), (0.02, 0.5, -0.03), (0.01, -0.03, 0.8)),
    torque_levels=(0.05, 0.005),
    torque_held=True,
)
CRAFT = {"pulses": Spacecraft(duration=6.0), "held": dataclasses.replace(WHEELED, duration=6.0)}
PLAIN = jax.tree_util.Partial(phase_plane)


def late(craft, delay):
    return AttitudeEnv(5, spacecraft=CRAFT[craft], world=world(actuators={"delay": delay}))


def recorded(controller, env, seed=0, slews=3):
    """History of the same random slews, whatever the world."""
    key = jax.random.key(seed)
    ideal = dataclasses.replace(env, world=attjax.World())
    start = evaluation.random_slews(ideal, env.default_params, key, slews)[1]
    steps = int(env.default_params.max_steps_in_episode)
    return evaluation.record(controller, env, env.default_params, key, start, steps)


@pytest.mark.parametrize("law", [phase_plane, quaternion_feedback])
def test_in_the_ideal_world_it_is_the_controller_to_the_bit(law):
    env = AttitudeEnv(20)
    bare, looped = (evaluation.evaluate(x, env, episodes=40) for x in (law, flight_loop(law)))
    assert bare == looped
    assert flight_loop(law).init(env.context(env.default_params)) is None


@pytest.mark.parametrize("craft", CRAFT)
@pytest.mark.parametrize("periods", [1, 2])
def test_a_known_delay_only_shifts_the_flight(craft, periods):
    """The predictor is exact: the controller decides as without delay, so many periods later."""
    with jax.enable_x64(True):
        prompt = recorded(PLAIN, late(craft, 0))
        delayed = recorded(flight_loop(PLAIN), late(craft, 6 * periods))
        unaware = recorded(PLAIN, late(craft, 6 * periods))
    for shifted, of_prompt in zip(jax.tree.leaves(delayed)[:2], jax.tree.leaves(prompt)[:2]):
        np.testing.assert_allclose(shifted[periods:], of_prompt[:-periods], rtol=0, atol=1e-11)
    assert np.max(np.abs(unaware.quaternion[periods:] - prompt.quaternion[:-periods])) > 1e-4


@pytest.mark.parametrize("delay", [1, 4, 7])
def test_it_looks_as_far_ahead_as_the_delay_is(delay):
    """Also where that is no whole number of periods: against RK4 steps one by one."""
    with jax.enable_x64(True):
        env = late("pulses", delay)
        params = env.default_params
        context, loop = env.context(params), flight_loop(lambda told, context: 5)
        _, state = env.reset(jax.random.key(4), params)
        memory = loop.init(context)
        for _ in range(3):
            action, memory = loop.step(memory, measured(state), context)
            state = env.step_env(jax.random.key(0), state, action, params)[1]
        told, memory = loop.observed(memory, measured(state), context)
        single = AttitudeEnv(0, spacecraft=CRAFT["pulses"], world=env.world)
        plant, now = state.plant, state
        for _ in range(delay):
            moved = plant.moved(
                single.context(params).agent_step, now.quaternion, now.angular_velocity, 0, None
            )
            plant = moved[2]
            now = now.replace(quaternion=moved[0], angular_velocity=moved[1])
        np.testing.assert_allclose(told[:4], now.quaternion, rtol=0, atol=1e-12)
        np.testing.assert_allclose(told[8:], now.angular_velocity, rtol=0, atol=1e-12)
        assert np.max(np.abs(told[:4] - state.quaternion)) > 1e-5


def test_impulses_of_a_control_period_are_counted():
    """Held and pulsed torques on their way, as they act between two decisions."""
    for craft, duration in (("pulses", 1 / 240), ("held", 4 / 240)):
        env = late(craft, 2)
        context = env.context(env.default_params)
        memory = flight_loop(PLAIN).init(context)
        torque = jnp.array([0.1, 0.0, -0.2])
        queue = memory.queue.and_then(2.0, torque)
        np.testing.assert_allclose(belief.impulse(queue, context), torque * duration, rtol=1e-6)


def test_it_is_a_tree_and_comes_from_a_run():
    loop = attjax.load_flight_loop("pretrained/precise")
    assert isinstance(loop, FlightLoop) and len(jax.tree.leaves(loop)) == 6
    assert flight_loop(loop) is loop
    env = AttitudeEnv(20)
    _, state = env.reset(jax.random.key(0), env.default_params)
    context = env.context(env.default_params)
    action, memory = jax.jit(loop.step)(loop.init(context), measured(state), context)
    act = attjax.load_policy("pretrained/precise")
    assert memory is None and int(action) == int(act(env.observe(None, state, None), context))


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_decisions_of_both_kinds(actions):
    env = AttitudeEnv(5, actions=actions, world=attjax.World.named("lm50-leo"))
    judged = evaluation.evaluate(flight_loop(phase_plane), env, episodes=20)
    assert judged["success_rate"] == 1.0
    assert judged["terminal"]["error_deg"]["max"] < 0.02
