"""Assurance after a loop that adapts: of what was believed before the flight, and told so."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from worlds import world

from attjax import AttitudeEnv, Spacecraft, flight_loop
from attjax.control import adaptation, adversaries, belief
from attjax.control.assured import assurance
from attjax.control.classical import phase_plane
from attjax.envs import observation as observations
from attjax.envs.leaning import leaned
from attjax.envs.parameters import measured
from attjax.evaluation.limits import limits, nearness

PARTIAL = jax.tree_util.Partial
CLOSEST = PARTIAL(lambda observation, context: -observation[8] * context.torque_table[:, 0])
"""Scores of a controller that takes out what it is shown about x."""

TURNED = world(
    uncertainty={"axes_turned_deg": 10, "change_factor": 1.5, "change_time": 2.0},
    actuators={"gain": {"uniform": [0.9, 1.1]}, "misalignment_deg": 10, "delay": 3},
)

LATE = world(actuators={"delay": {"uniform": [0, 12]}})


def begun(env, steps=30):
    """A loop that adapts, its memory after so many decisions of any torque, and the context."""
    context = env.context(env.default_params)
    loop = flight_loop(lambda told, context: (told[0] > 0) * 3 + 1, adapts=True)
    state = env.reset(jax.random.key(1), env.default_params)[1]

    def step(carry, _):
        memory, state = carry
        action, memory = loop.step(memory, measured(state), context)
        return (memory, env.step_env(jax.random.key(0), state, action, env.default_params)[1]), 0

    start = (loop.init(context), state)
    (memory, state), _ = jax.jit(lambda start: jax.lax.scan(step, start, None, steps))(start)
    return memory, state, context


@pytest.mark.parametrize("flown_in", [TURNED, LATE], ids=["turned", "late"])
def test_an_adversary_that_knows_what_is_identified_passes_no_limit(flown_in):
    """Axes and torques turned, a delay, and a mass that comes in mid-flight; any delay."""
    env = AttitudeEnv(5, spacecraft=Spacecraft(duration=8.0), world=flown_in)
    of_this, within = assurance(env), limits(env)
    assert of_this.is_certain
    scores = PARTIAL(adversaries.fastest)
    crew = (flight_loop(None, adapts=True, assurance=of_this, scores=scores),)
    (near,) = nearness(crew, env, within, jax.random.key(0), 32)
    assert 0.8 < np.max(near.rate) <= 1


def test_where_the_truth_is_told_it_is_estimated():
    """Not a filter's mean of it: the assurance counts on no error."""
    env = AttitudeEnv(5, world=world(uncertainty={"axes_turned_deg": 10}))
    memory, state, context = begun(env)
    loop = flight_loop(phase_plane, adapts=True)
    observation, memory = loop.observed(memory, measured(state), context)
    np.testing.assert_array_equal(observation[8:], state.angular_velocity)
    np.testing.assert_array_equal(observation[:4], state.quaternion)


def test_it_is_told_the_rate_as_it_is_not_leaned():
    """Leaned against a torque, the rate seems to be far within the limit."""
    env = AttitudeEnv(5, world=world(disturbances={"constant_torque": 0.001}))
    memory, _, context = begun(env)
    pushed = tuple(jnp.array([0.0, -0.5, 0.0]))
    memory = memory.replace(estimate=memory.estimate.replace(torque=pushed))
    of_this = assurance(env)
    observation = observations.observe(jnp.array([0.0, 0, 0, 1]), jnp.array([0.0, 0.4985, 0.0]))
    known = flight_loop(phase_plane, adapts=True).believed(memory, context)
    shown = leaned(observation, dataclasses.replace(known, disturbance=jnp.stack(pushed)))
    assert shown[9] < 0.45
    up = 3  # 0.5 N m about y
    assert not of_this.admissible(observation[:4], observation[8:])[up]
    assert of_this.admissible(shown[:4], shown[8:])[up]
    loop = flight_loop(lambda told, context: up, adapts=True, assurance=of_this)
    assert int(loop.act(memory, observation, context)) != up


def test_it_looks_across_a_delay_as_was_believed_before_the_flight():
    """Torques under way count as much as then, whatever has been identified; and no others."""
    late, pushed = {"gain": {"uniform": [0.9, 1.1]}, "delay": 6}, {"constant_torque": 0.001}
    env = AttitudeEnv(5, world=world(actuators=late, disturbances=pushed))
    memory, _, context = begun(env)
    rate = tuple(jnp.array([0.0, 0.49, 0.0]))
    level = tuple(jnp.array([0.0, 0.0, 0.0, 1.0]))
    estimate = memory.estimate.replace(quaternion=level, angular_velocity=rate, torque=level[1:])
    down = adaptation.commanded(4, context)
    queue = memory.queue.replace(torques=0 * memory.queue.torques)
    queue = queue.and_then(0, down)
    weaker = memory.identity.replace(strengths=tuple(0 * x for x in memory.identity.strengths))
    memory = memory.replace(estimate=estimate, queue=queue, identity=weaker)
    plain = queue.replace(torques=jnp.sum(queue.torques.reshape(-1, 3, 3), axis=1))
    after = belief.after_delay(estimate.replace(torque=None), plain, context)
    lowest = jnp.stack(after.angular_velocity)
    assert float(lowest[1]) < 0.475
    of_this, told = assurance(env), []

    class Listening:
        def chosen(self, observation, scores):
            told.append(observation)
            return of_this.chosen(observation, scores)

    loop = flight_loop(None, adapts=True, assurance=of_this, scores=CLOSEST)
    object.__setattr__(loop, "assurance", Listening())
    loop.act(memory, jnp.zeros(11).at[3].set(1), context)
    np.testing.assert_allclose(told[0][8:], lowest, atol=1e-6)


def test_what_is_identified_is_for_the_controller():
    """The law under assurance decides as it does alone, where no limit is near."""
    env = AttitudeEnv(5, world=world(uncertainty={"moment_factor": {"uniform": [0.6, 1.4]}}))
    memory, state, context = begun(env)
    alone = flight_loop(phase_plane, adapts=True)
    memory = alone.observed(memory, measured(state), context)[1]
    assured = flight_loop(alone, assurance=assurance(env))
    assert assured.adapts
    known, angles = alone.believed(memory, context), np.linspace(-2e-4, 2e-4, 201)
    still = jnp.zeros(3)
    told = [observations.observe(jnp.array([x, 0.5 * x, 0, 1]), still) for x in angles]

    def decided(act):
        return [int(x) for x in jax.vmap(act)(jnp.stack(told))]

    wanted = decided(lambda x: phase_plane(x, known))
    assert decided(lambda x: assured.act(memory, x, context)) == wanted
    assert decided(lambda x: alone.act(memory, x, context)) == wanted
    assert decided(lambda x: phase_plane(x, context)) != wanted


def test_wheels_that_something_docks_to_have_no_bound():
    changed = world(
        actuators={"wheels": {"inertia": 1e-4, "most_speed": 500}},
        uncertainty={"change_factor": 2.0, "change_time": 1.0},
    )
    with pytest.raises(ValueError, match="no bound of change_factor beside reaction wheels"):
        assurance(AttitudeEnv(5, world=changed))
