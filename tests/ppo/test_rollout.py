"""How spacecraft start, act and are counted in training."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from setups import PLAIN, fly, small_attitude_setup

import attjax
from attjax import ppo
from attjax.config import presets
from attjax.ppo import train, train_state
from attjax.ppo.distributions import Categorical
from attjax.ppo.rollout import encode, episode_sums, greedy_rows
from attjax.runs import build


def test_spacecraft_are_shared_out_among_the_control_rates():
    setup = small_attitude_setup(1, frameskips=(5, 7, 10, 14, 20))
    sizes = [group.stop - group.start for group in setup.slices]
    assert sum(sizes) == 64 and set(sizes) == {12, 13}
    env_params = build.env_params(setup)
    discounts = train.discounts(setup.env, env_params, setup.settings.ppo, 64)
    features = encode(setup.env, setup.policy, env_params, jnp.zeros((64, 11))).features
    for frameskip, group in zip((5, 7, 10, 14, 20), setup.slices):
        assert set(env_params.frameskip[group].tolist()) == {frameskip}
        period = (1 + frameskip) / 240
        np.testing.assert_allclose(discounts[group], 0.995 ** (period / 0.025), rtol=1e-6)
        np.testing.assert_allclose(features[group, -2], 10 * period, rtol=1e-6)


def test_every_control_rate_has_spacecraft_on_any_number_of_devices(monkeypatch):
    for devices in range(1, 9):
        monkeypatch.setattr(jax, "devices", lambda *_, devices=devices: [None] * devices)
        for num_envs in (5, 6, 8, 16, 64):
            settings = presets.PRECISE.replace(
                num_envs=num_envs, rollout_length=4096, minibatch_size=4096
            )
            setup = build.setup(settings, num_devices=build.num_devices(settings))
            assert all(group.start < group.stop for group in setup.slices), (devices, num_envs)
    settings = settings.replace(num_envs=6)
    with pytest.raises(ValueError, match="num_devices is 2, for 3 spacecraft each; they must be"):
        build.setup(settings, num_devices=2)


def test_rollout_and_gradient_steps_each_leave_a_fresh_key():
    """A key used twice, in a rollout and for its shuffles, would tie them to each other."""
    setup = small_attitude_setup(2)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    flown, _ = fly(setup, env_params, state)
    keys = [np.array(jax.random.key_data(x.key)) for x in (state, flown)]
    trained, _ = ppo.train_block(setup, env_params, state, 1)
    keys.append(np.array(jax.random.key_data(trained.key)))
    assert len(np.unique(keys, axis=0)) == 3


@pytest.mark.parametrize("share", [0.0, 0.125])
def test_a_share_of_the_spacecraft_acts_greedily(share):
    setup = small_attitude_setup(1, greedy_share=share)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    _, steps = fly(setup, env_params, state)
    distribution = jax.vmap(setup.policy.distribution, (None, 0))(state.params, steps.inputs)
    log_probabilities = distribution.log_probabilities
    is_most_probable = steps.action == jnp.argmax(log_probabilities, axis=1)
    greedy = greedy_rows(64, share)
    assert [greedy[group].sum() for group in setup.slices] == [32 * share, 32 * share]
    assert is_most_probable[:, greedy].all()
    # An untrained policy is close to uniform over 19 actions.
    assert is_most_probable[:, ~greedy].mean() < 0.2
    chosen = jnp.take_along_axis(log_probabilities, steps.action[:, None], axis=1)[:, 0]
    np.testing.assert_allclose(steps.log_probability, chosen, rtol=1e-5)


def test_only_whole_episodes_count_in_the_metrics():
    setup = small_attitude_setup(
        1,
        frameskips=(20,),
        rollout_length=40,
        max_episode_steps=10,
        near_goal_share=0.5,
        near_goal_steps=3,
        stagger_episodes=False,
    )
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    _, steps = fly(setup, env_params, state)
    assert not steps.terminated.any()
    ends = [np.flatnonzero(column) for column in np.asarray(steps.truncated).T]
    lengths = np.concatenate([np.diff(rows, prepend=-1) for rows in ends])
    assert set(lengths.tolist()) == {3, 10}
    sums = episode_sums(steps, setup.slices)
    assert sums["episodes"] == (lengths == 10).sum()
    whole = steps.truncated & steps.is_whole
    assert sums["terminal_error_deg"] == pytest.approx(
        float(jnp.sum(whole * steps.outcome["terminal_error_deg"])), rel=1e-5
    )


def test_training_episodes_are_capped_in_agent_steps():
    """The slow rates keep their 43.75 s, the fast ones are cut; the paper's are untouched."""
    setup = small_attitude_setup(1, frameskips=(5, 7, 10, 14, 20), max_episode_steps=700)
    limits = build.env_params(setup).max_steps_in_episode
    for limit, group in zip([700, 700, 700, 700, 500], setup.slices):
        assert set(limits[group].tolist()) == {limit}
    paper = build.setup(presets.PAPER)
    assert build.env_params(paper).max_steps_in_episode == 500


def test_staggered_episodes_start_at_random_times():
    staggered = small_attitude_setup(1, near_goal_share=0.0)
    env_params = build.env_params(staggered)
    times = train_state.init(staggered, env_params, jax.random.key(0)).states.time
    assert len(set(times.tolist())) > 5 and int(times.max()) < 700
    together = dataclasses.replace(
        staggered, settings=staggered.settings.replace(stagger_episodes=False)
    )
    assert not train_state.init(together, env_params, jax.random.key(0)).states.time.any()


def test_sampled_actions_follow_their_probabilities_and_never_the_mask():
    probabilities = jnp.array([0.0, 0.1, 0.0, 0.6, 0.3, 0.0])
    log_probabilities = jnp.broadcast_to(jnp.log(probabilities)[:, None], (6, 200_000))
    uniform = jax.random.uniform(jax.random.key(0), (200_000,))
    counts = jnp.bincount(Categorical(log_probabilities).draw(uniform), length=6)
    # Five standard deviations of a frequency.
    np.testing.assert_allclose(counts / 200_000, probabilities, atol=5 * 0.5 / 200_000**0.5)
    assert counts[jnp.array([0, 2, 5])].sum() == 0


@pytest.mark.parametrize("num_devices", [1, 2])
def test_every_spacecraft_and_device_draws_its_own_numbers(num_devices):
    setup = small_attitude_setup(1, near_goal_share=0.0, greedy_share=0.0)
    setup = dataclasses.replace(setup, num_devices=num_devices)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    assert len(np.unique(state.states.quaternion[:, 3])) == 64
    _, steps = fly(setup, env_params, state)
    assert steps.action.shape == (16, 64)
    assert len(np.unique(steps.action, axis=1).T) == 64


def test_devices_hold_the_control_rates_of_their_part():
    """Row i of a device steps with the control period that the policy is told."""
    setup = dataclasses.replace(small_attitude_setup(1, near_goal_share=0.0), num_devices=2)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    before = state.states
    _, steps = fly(setup, env_params, state)
    first = jax.tree.map(lambda x: x[0], steps)
    for group, frameskip in enumerate(setup.settings.task.frameskips):
        rows = np.flatnonzero(np.tile(setup.group_of_row, 2) == group)
        start, action = jax.tree.map(lambda x, rows=rows: x[rows], (before, first.action))
        step = jax.vmap(attjax.step, (0, 0, None, None))
        after = step(start, action, None, frameskip)
        np.testing.assert_allclose(first.final_observation[rows, :4], after.quaternion, atol=1e-6)


@pytest.mark.parametrize("scale", [1.0, 0.005])
def test_the_learner_sees_the_reward_times_its_scale(scale):
    """The score of an episode's first step is its reward; both are Eq. 12-13 here."""
    setup = small_attitude_setup(1, PLAIN, frameskips=(20,), rollout_length=2, reward_scale=scale)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    _, steps = fly(setup, env_params, state)
    assert np.ptp(steps.score[0]) > 0.1
    np.testing.assert_allclose(steps.reward[0], scale * steps.score[0], rtol=1e-6)
    ongoing = ~(steps.terminated[0] | steps.truncated[0])
    second = steps.score[1] - steps.score[0]
    np.testing.assert_allclose(
        steps.reward[1][ongoing], scale * second[ongoing], rtol=1e-4, atol=1e-6
    )
