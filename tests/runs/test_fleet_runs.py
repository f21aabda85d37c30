"""Training on a fleet: which spacecraft fly when, and that a run that stopped goes on the same."""

import jax
import numpy as np
import pytest

import attjax
from attjax.config import run as run_config
from attjax.errors import UserValueError
from attjax.ppo import train_state
from attjax.runs import build
from attjax.runs.keeper import Place
from attjax.spacecraft import Spacecraft
from attjax.world import Actuators, Sensors, StarTracker, Uniform, World

SMALL = {
    "frameskips": (1, 3), "num_envs": 8, "rollout_length": 2, "minibatch_size": 8, "passes": 1,
    "hidden_sizes": (4,), "updates_per_block": 5, "total_steps": 8 * 2 * 36,
}  # fmt: skip

NOISY = World(
    sensors=Sensors(star_tracker=StarTracker(cross_boresight_arcsec=5, roll_arcsec=5)),
    actuators=Actuators(gain=Uniform(0.9, 1.1)),
)


def trained(folder=None, stop_after=None, **values):
    def stops(row):
        return stop_after is not None and row["agent_steps"] >= 16 * stop_after

    return attjax.train("universal", folder=folder, callback=stops, **SMALL | values)


def test_a_fleet_flies_for_32_updates():
    setup = build.of_config(run_config.new("universal", **SMALL))
    first, same, second = (build.env_params(setup, 7, n) for n in (0, 31, 32))
    other = build.env_params(setup, 8, 0)
    np.testing.assert_array_equal(first.inertia, same.inertia)
    rows = setup.envs_per_device
    for params in (first, second, other):
        assert params.inertia.shape == (rows, 3, 3) and params.rate_limit.shape == (rows,)
        assert params.torque_table.shape == (rows, 19, 3)
    assert not np.any(np.isclose(first.inertia[:, 0, 0], second.inertia[:, 0, 0]))
    assert not np.any(np.isclose(first.inertia[:, 0, 0], other.inertia[:, 0, 0]))


def test_what_is_wrong_with_a_fleet():
    """Dead axes by their share; a constant torque in the ideal world alone, which has none."""
    many = SMALL | {"num_envs": 512, "minibatch_size": 512}
    for preset, world, share in (("universal", World(), 0), ("two-torques", NOISY, 1)):
        setup = build.of_config(run_config.new(preset, world=world, **many))
        params = build.env_params(setup, 7, 0)
        dead = np.all(params.torque_table == 0, axis=1)
        assert np.all(np.sum(dead, axis=1) == share)
        assert world.is_ideal == (params.disturbance is not None)
        if world.is_ideal:
            assert 0.05 < np.mean(np.any(params.disturbance != 0, axis=1)) < 0.2
    half = run_config.new("universal", crippled_share=0.5, **many)
    table = build.env_params(build.of_config(half), 7, 0).torque_table
    assert 0.3 < np.mean(np.any(np.all(table == 0, axis=1), axis=1)) < 0.7


def test_blocks_end_where_a_fleet_does():
    """With blocks of five updates the seventh has two; then all start an episode anew."""
    steps = []

    def seen(row):
        steps.append(row["agent_steps"] // 16)

    run = attjax.train("universal", callback=seen, **SMALL)
    assert steps == [5, 10, 15, 20, 25, 30, 32, 36]
    expected = build.env_params(run.setup, 0, 32)
    np.testing.assert_array_equal(run.env_params.inertia, expected.inertia)


LOOPED = {"world": NOISY, "in_flight_loop": True}


@pytest.mark.parametrize(("stop_after", "values"), [(30, {}), (32, {}), (36, {}), (33, LOOPED)])
def test_a_run_that_stopped_goes_on_the_same(tmp_path, stop_after, values):
    """Its flight loops, too, remember what they did."""
    whole = trained(total_steps=8 * 2 * 42, **values)
    trained(tmp_path, stop_after, total_steps=8 * 2 * 42, **values)
    resumed = attjax.train(folder=Place(folder=tmp_path, resume=True))
    for a, b in zip(*map(jax.tree.leaves, (whole.learner.params, resumed.learner.params))):
        np.testing.assert_array_equal(a, b)
    for a, b in zip(*map(jax.tree.leaves, (whole.learner.states, resumed.learner.states))):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(whole.env_params.inertia, resumed.env_params.inertia)


def test_a_learner_in_a_flight_loop_sees_what_that_believes():
    """And the flight loop believes each spacecraft of a fleet to be itself."""
    run = trained(stop_after=5, **LOOPED)
    states, observation = run.learner.states, np.asarray(run.learner.observation)
    believed = np.stack(states.memory.estimate.quaternion, axis=1)
    np.testing.assert_array_equal(observation[:, :4], believed)
    error = np.abs(believed - np.asarray(states.quaternion))
    assert 0 < error.max() < 1e-4
    bare = trained(stop_after=5, world=NOISY)
    assert not hasattr(bare.learner.states, "memory")


def test_all_start_anew_with_a_fleet():
    run = trained(stop_after=5, stagger_episodes=False, near_goal_share=0.0)
    params = build.env_params(run.setup, 0, 32)
    assert np.all(np.asarray(run.learner.states.time) > 0)
    anew = train_state.restarted(run.setup, params, run.learner, jax.random.key(1))
    assert not np.any(np.asarray(anew.states.angular_velocity)) and np.all(anew.is_whole)
    assert not np.any(anew.score) and not np.any(np.asarray(anew.states.time))
    np.testing.assert_allclose(anew.observation[:, :4], anew.states.quaternion)
    assert len(np.unique(anew.observation[:, 3])) == SMALL["num_envs"]
    for a, b in zip(*map(jax.tree.leaves, (run.learner.params, anew.params))):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"actions": "continuous"}, "any_spacecraft is for discrete actions, not continuous"),
        (
            {"any_spacecraft": False, "crippled_share": 0.1},
            "crippled_share is for any_spacecraft",
        ),
        (
            {"actions": "continuous", "any_spacecraft": False},
            "universal features are for discrete actions",
        ),
        ({"spacecraft": Spacecraft(torque_held=True)}, "LM50, whose episodes they fly, has held"),
        (
            {"spacecraft": Spacecraft(torque_levels=(0.1,))},
            "19 actions, pulses; LM50, whose episodes they fly, has 7 actions",
        ),
        (
            {"spacecraft": Spacecraft(torque_axes=((1, 0, 0), (0, 1, 0))), "any_spacecraft": False},
            "LM50 has 2 torque_axes; universal inputs are for 3",
        ),
    ],
)
def test_what_a_fleet_cannot_be_is_refused(values, said):
    with pytest.raises(UserValueError, match=said):
        trained(**values)
