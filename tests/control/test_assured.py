"""Run-time assurance in closed loop, its ranking, and what it does not know of."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from worlds import world

import attjax
from attjax import AttitudeEnv, Spacecraft, evaluation, flight_loop
from attjax.control import adversaries
from attjax.control.assured import assurance, assured
from attjax.control.classical import phase_plane
from attjax.dynamics import rigid_body
from attjax.envs import initial_state
from attjax.evaluation.limits import limits, nearness
from attjax.runs import checkpoint
from attjax.world import KeepOut, Uniform, World

ENV = AttitudeEnv(5)
SHORT = Spacecraft(duration=8.0)
CONES = (
    KeepOut(axis=(0, 0, 1), direction=(1, 0, 0), half_angle_deg=30),
    KeepOut(axis=(1, 0, 0), direction=(0, -1, 1), half_angle_deg=20),
)
PARTIAL = jax.tree_util.Partial
SCORES = {
    "fastest": PARTIAL(adversaries.fastest),
    "hesitating": PARTIAL(adversaries.hesitating),
    "random": PARTIAL(adversaries.at_random, jax.random.key(1)),
}
WORLDS = {
    "ideal": World(),
    "plants": world(
        uncertainty={"moment_factor": Uniform(0.9, 1.1), "axes_turned_deg": 1},
        actuators={"gain": 1.05, "misalignment_deg": 2, "dead_levels": [3]},
        disturbances={"constant_torque": 0.001},
    ),
    "late": world(
        uncertainty={"moment_factor": 0.9},
        actuators={"delay": {"uniform": [4, 8]}, "delay_jitter": {"uniform": [0, 2]}},
    ),
    "sooner or later": world(actuators={"delay": {"uniform": [4, 8]}}),
    "up to two periods": world(actuators={"delay": {"uniform": [0, 12]}}),
}


def flown(env, keep_out=(), flights=32, start=None):
    """How near the adversaries come, and the assurance."""
    if start is not None:
        env = dataclasses.replace(env, initial_state=start)
    of_this, within = assurance(env, keep_out), limits(env, keep_out)
    scores = dict(SCORES)
    if keep_out:
        scores["cones"] = PARTIAL(adversaries.into_cones, within.cones)
    crew = tuple(flight_loop(None, assurance=of_this, scores=x) for x in scores.values())
    return nearness(crew, env, within, jax.random.key(0), flights), of_this


@pytest.mark.parametrize("name", WORLDS)
def test_no_policy_passes_the_rate_limit(name):
    env = AttitudeEnv(5, spacecraft=SHORT, world=WORLDS[name])
    near, of_this = flown(env)
    assert of_this.is_certain
    assert max(np.max(x.rate) for x in near) <= 1
    if name == "ideal":  # where all is known, nothing is given away
        assert max(np.max(x.rate) for x in near) > 0.99


@pytest.mark.parametrize("name", ["ideal", "sooner or later", "up to two periods"])
def test_nor_from_any_rate_within_it(name):
    """Also where a torque that has come may be counted on again."""

    def start(key, params):
        state = initial_state.initial_state(key, params)
        direction, share = jax.random.split(jax.random.fold_in(key, 1))
        rate = jax.random.normal(direction, (3,))
        peak = rigid_body.peak_rate(rate, params.inertia)
        wanted = 0.998 * params.rate_limit * jax.random.uniform(share) ** 0.1
        return state.replace(angular_velocity=rate * wanted / peak)

    env = AttitudeEnv(5, spacecraft=SHORT, world=WORLDS[name])
    near, of_this = flown(env, flights=96, start=start)
    assert of_this.is_certain and max(np.max(x.rate) for x in near) <= 1


@pytest.mark.parametrize("name", ["ideal", "plants"])
def test_no_policy_enters_a_cone(name):
    env = AttitudeEnv(5, spacecraft=SHORT, world=WORLDS[name])
    near, of_this = flown(env, CONES, 48)
    assert of_this.is_certain
    for of_policy in near:
        begun = of_policy.started > float(of_this.reserve)
        assert begun.sum() > 20
        assert np.min(of_policy.clearance[begun]) >= 0
    if name == "ideal":  # and they come near
        assert min(np.min(x.clearance[x.started > 0.1]) for x in near) < np.deg2rad(3)


def test_without_it_they_do():
    env = AttitudeEnv(5, spacecraft=SHORT)
    within = limits(env, CONES)

    def reckless(observation, context):
        return jnp.argmax(adversaries.into_cones(within.cones, observation, context))

    near = nearness((PARTIAL(reckless),), env, within, jax.random.key(0), 32)[0]
    assert np.mean(near.clearance < 0) > 0.5 and np.mean(near.rate > 1) > 0.5


def test_wheels_stay_below_their_speed():
    wheeled = World.named("cubesat-6u")
    env = AttitudeEnv(5, spacecraft=attjax.world.made_for(wheeled), world=wheeled)
    craft = dataclasses.replace(env.spacecraft, duration=20.0)
    near, of_this = flown(dataclasses.replace(env, spacecraft=craft), flights=16)
    assert of_this.is_certain and float(of_this.limit) < 0.1
    assert 0.2 < max(np.max(x.wheels) for x in near) <= 1


def test_a_policy_that_keeps_the_limits_flies_the_same_to_the_bit():
    policy, params = checkpoint.restore_network("pretrained/precise")
    act = PARTIAL(policy.act, params)
    loop = flight_loop(act, assurance=assurance(ENV), scores=PARTIAL(policy.scores, params))
    bare, guarded = (evaluation.evaluate(x, ENV, episodes=40) for x in (act, loop))
    assert bare == guarded
    observation, _ = ENV.reset(jax.random.key(3))
    context = ENV.context(ENV.default_params)
    assert int(jnp.argmax(policy.scores(params, observation, context))) == int(
        act(observation, context)
    )


def test_what_is_not_let_through_gives_way_to_the_best_that_is():
    """At the limit about y: the nearest impulse to more of it; by scores, whatever they like."""
    of_this = assurance(ENV)
    context = ENV.context(ENV.default_params)
    observation = jnp.zeros(11).at[3].set(1).at[9].set(0.4994)
    allowed = of_this.admissible(observation[:4], observation[8:])
    assert not allowed[3] and allowed[4] and allowed[0]
    wanting = assured(lambda told, context: 3, of_this)  # 0.5 N m about y
    given = int(wanting(observation, context))
    missing = np.linalg.norm(np.asarray(context.torque_table) - [0, 0.5, 0], axis=1)
    assert given == int(np.argmin(np.where(allowed, missing, np.inf))) != 3
    for wish in range(19):
        scores = assured(None, of_this, lambda told, context, n=wish: -jnp.abs(jnp.arange(19) - n))
        chosen = int(scores(observation, context))
        assert allowed[chosen] and (chosen == wish or not allowed[wish])
    slow = observation.at[9].set(0.1)
    assert int(wanting(slow, context)) == 3


def test_there_is_always_an_action_and_braking_is_one():
    of_this = assurance(ENV, CONES)
    rng = np.random.default_rng(0)
    quaternion = rng.normal(size=(500, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    rate = rng.normal(size=(500, 3)) * rng.uniform(0, 0.6, (500, 1))  # beyond all limits, too
    allowed = jax.vmap(of_this.admissible)(jnp.asarray(quaternion), jnp.asarray(rate))
    change = jax.vmap(of_this.changes)(jnp.asarray(rate))[1]
    assert np.all(np.take_along_axis(np.asarray(allowed), np.argmin(change, 1)[:, None], 1))
    assert 0 < np.mean(np.sum(allowed, axis=1) == 1) < 1


def test_a_slower_target_is_reached_at_the_same_time():
    """The classical law under it, in the ideal world: nothing is lost."""
    bare, guarded = (
        evaluation.evaluate(x, ENV, episodes=40)["settling_time_s"]["mean"]
        for x in (phase_plane, flight_loop(phase_plane, assurance=assurance(ENV)))
    )
    assert guarded == pytest.approx(bare, rel=0.01)


def test_worlds_without_bounds_are_refused_by_name():
    def refused(match, **given):
        with pytest.raises(ValueError, match=match):
            assurance(dataclasses.replace(ENV, **given))

    refused("finite set of actions", actions="continuous")
    flexible = {"flexible": {"frequency": 1.0, "participation": 0.05}}
    refused("does not know of disturbances.flexible", world=world(disturbances=flexible))
    slow = world(sensors={"gyro": {"rate_limit": 0.4}})
    refused("sensors.gyro.rate_limit is 0.4", world=slow)
    late = world(actuators={"delay_jitter": {"uniform": [0, 6]}})
    refused("delay_jitter is of up to 6 RK4 steps, a control period of 6", world=late)
    wheels = {"wheels": {"inertia": 1e-4, "most_speed": 500, "start_speed": 499}}
    refused("nothing is left to turn with", world=world(actuators=wheels))
    pyramid = Spacecraft(torque_axes=((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)))
    plain = world(actuators={"wheels": {"inertia": 1e-4}})
    refused("three wheels", world=plain, spacecraft=pyramid)


def test_what_cannot_be_proved_is_said():
    weak = world(disturbances={"constant_torque": 0.2})
    assert not assurance(AttitudeEnv(5, world=weak)).is_certain
    dead = AttitudeEnv(5, world=world(actuators={"faulty_axes": [1]}))
    assert assurance(dead).is_certain and not assurance(dead, CONES).is_certain
