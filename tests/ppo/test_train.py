import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import programs
import pytest
from jax.sharding import PartitionSpec
from probes import Probe
from setups import PLAIN, fly, settings, small_attitude_setup

from attjax import AttitudeEnv, ppo, sharding
from attjax.config import presets
from attjax.ppo import descent, train_state
from attjax.ppo.networks import Policy
from attjax.runs import build


def train(setup, env_params):
    state = train_state.init(setup, env_params, jax.random.key(0))
    return ppo.train_block(setup, env_params, state, setup.settings.ppo.num_updates)


def train_probe(probe, updates=60, num_devices=1, **overrides):
    policy = Policy(hidden_sizes=(32, 32), num_actions=2)
    setup = train_state.Setup(
        probe, policy, settings(updates, **overrides), num_devices=num_devices
    )
    state, _ = train(setup, probe.default_params)

    def value(*observation):
        return float(policy.value(state.params, jnp.array([observation], float))[0])

    def probability(action, *observation):
        inputs = jax.vmap(policy.encode, (0, None))(jnp.array([observation], float), None)
        distribution = policy.distribution(state.params, inputs)
        return float(jnp.exp(distribution.log_probability(jnp.array([action])))[0])

    return value, probability


def test_value_of_a_constant_reward():
    value, _ = train_probe(Probe("constant"))
    assert value(1, 0) == pytest.approx(1, abs=0.05)


def test_value_that_depends_on_the_observation():
    value, _ = train_probe(Probe("sign"))
    assert value(1, 0) == pytest.approx(1, abs=0.05)
    assert value(-1, 0) == pytest.approx(-1, abs=0.05)


def test_value_of_a_delayed_reward_is_discounted():
    value, _ = train_probe(Probe("last", length=3), discount=0.8)
    for step in range(3):
        assert value(1, step / 3) == pytest.approx(0.8 ** (2 - step), abs=0.07)


@pytest.mark.parametrize("num_devices", [1, 2])
def test_actions_follow_the_advantage(num_devices):
    _, probability = train_probe(Probe("match"), num_devices=num_devices)
    assert probability(1, 1, 0) > 0.95
    assert probability(0, -1, 0) > 0.95


@pytest.mark.parametrize("num_devices", [1, 2])
def test_continuous_actions_follow_the_advantage(num_devices):
    """About the first axis what the sign asks for, ½ or −½; about the others none; and surely."""
    policy = Policy(hidden_sizes=(32, 32), actions="continuous")
    probe = Probe("aim")
    setup = train_state.Setup(probe, policy, settings(120), num_devices=num_devices)
    state, _ = train(setup, probe.default_params)
    observed = jnp.array([[1.0, 0.0], [-1.0, 0.0]])
    inputs = jax.vmap(policy.encode, (0, None))(observed, None)
    distribution = policy.distribution(state.params, inputs)
    np.testing.assert_allclose(distribution.mode(), [[0.5, 0, 0], [-0.5, 0, 0]], atol=0.1)
    assert float(jnp.max(distribution.log_std)) < -1


def test_value_bootstraps_at_the_time_limit_where_asked():
    """1 a step for ever is worth 1/(1 − γ) = 5, but only 2.44 if the 3rd step is the last."""
    endless = Probe("constant", length=3, truncates=True, shows_time=False)
    value, _ = train_probe(endless, discount=0.8, time_limit_terminates=False, updates=150)
    assert value(1, 0) == pytest.approx(5, abs=0.1)
    limited = Probe("constant", length=3, truncates=True)
    value, _ = train_probe(limited, discount=0.8, time_limit_terminates=True)
    assert value(1, 0) == pytest.approx(1 + 0.8 + 0.64, abs=0.15)


def test_value_does_not_bootstrap_over_a_termination():
    value, _ = train_probe(Probe("constant", length=3), discount=0.8, time_limit_terminates=False)
    assert value(1, 2 / 3) == pytest.approx(1, abs=0.1)


def test_a_short_training_improves_the_return():
    setup = small_attitude_setup(
        120,
        PLAIN,
        num_envs=128,
        rollout_length=64,
        reward_scale=0.01,
        minibatch_size=512,
    )
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    returns = []
    for _ in range(4):
        state, metrics = ppo.train_block(setup, env_params, state, 30)
        sums = metrics["episodes"]
        mean = sums["score"] / sums["episodes"]
        error = jnp.sqrt((sums["score_squared"] / sums["episodes"] - mean**2) / sums["episodes"])
        returns.append((float(mean[0]), float(error[0])))
    (first, first_error), (last, last_error) = returns[0], returns[-1]
    assert last - first > 5 * np.hypot(first_error, last_error)


def test_one_compilation_serves_blocks_of_any_length():
    setup = small_attitude_setup(10)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    before = programs.held(ppo.train_block)
    for length in (1, 2, 3):
        state, _ = ppo.train_block(setup, env_params, state, length)
    assert programs.held(ppo.train_block) == before + 1
    assert state.update == 6


def test_blocks_of_any_length_give_the_same_bits():
    setup = small_attitude_setup(4)
    env_params = build.env_params(setup)
    results = []
    for lengths in ((4,), (1, 3)):
        state = train_state.init(setup, env_params, jax.random.key(7))
        for length in lengths:
            state, _ = ppo.train_block(setup, env_params, state, length)
        results.append(jax.tree.map(np.asarray, state.params))
    jax.tree.map(np.testing.assert_array_equal, *results)


def test_learning_rate_anneals_over_the_whole_run():
    """Adam's first step moves each parameter by the learning rate; the last by the final one."""
    chosen = settings(3, passes=2, learning_rate=1e-2, final_learning_rate=1e-4)
    assert (chosen.ppo.num_updates, chosen.ppo.minibatches) == (3, 8)
    transformation = train_state.optimizer(chosen.ppo)
    gradient = jnp.ones(())
    state = transformation.init(gradient)
    moves = []
    for _ in range(3 * 2 * 8 + 1):
        move, state = transformation.update(gradient, state)
        moves.append(-float(move))
    np.testing.assert_allclose(moves, np.linspace(1e-2, 1e-4, 49), rtol=1e-3)


def test_entropy_bonus_anneals_over_the_whole_run():
    chosen = settings(4, entropy_coefficient=0.01, final_entropy_coefficient=0.002)
    weights = [float(train_state.entropy_coefficient(chosen.ppo, jnp.int32(i))) for i in range(5)]
    np.testing.assert_allclose(weights, [0.01, 0.008, 0.006, 0.004, 0.002], rtol=1e-6)


def test_entropy_bonus_is_what_its_weight_takes_off_the_loss():
    setup = small_attitude_setup(1)
    env_params = build.env_params(setup)
    params = train_state.init(setup, env_params, jax.random.key(0)).params
    context = AttitudeEnv(5).context(AttitudeEnv(5).default_params)
    observation = jnp.zeros((5, 11)).at[:, 8].set(jnp.linspace(0, 0.3, 5))
    inputs = jax.vmap(setup.policy.encode, (0, None))(observation, context)
    old = -jnp.log(19.0) * jnp.ones(5)
    sample = descent.Sample(inputs, jnp.zeros(5, int), old, jnp.arange(5.0), jnp.ones(5))
    plain, metrics = descent.loss(setup.policy, params, sample, descent.LossWeights(0.2, 0.0))
    rewarded, _ = descent.loss(setup.policy, params, sample, descent.LossWeights(0.2, 0.5))
    assert metrics["entropy"] == pytest.approx(np.log(19), rel=1e-2)
    assert plain - rewarded == pytest.approx(0.5 * float(metrics["entropy"]), rel=1e-5)


@pytest.mark.parametrize("spoiled", ["observations", "parameters"])
def test_divergence_names_its_first_update(spoiled):
    setup = small_attitude_setup(4)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    if spoiled == "observations":
        states = state.states
        states = states.replace(quaternion=states.quaternion.at[0].set(jnp.nan))
        observation = state.observation.at[0].set(jnp.nan)
        state = state.replace(states=states, observation=observation)
    else:
        params = jax.tree.map(lambda x: x.at[0].set(jnp.inf), state.params)
        state = state.replace(params=params)
    _, metrics = ppo.train_block(setup, env_params, state, 2)
    assert metrics["diverged"][spoiled] == 0


def test_healthy_runs_do_not_diverge():
    setup = small_attitude_setup(2)
    _, metrics = train(setup, build.env_params(setup))
    assert {int(update) for update in metrics["diverged"].values()} == {-1}


def test_two_devices_take_the_gradient_step_of_one():
    """One minibatch holds all samples, so their order and their halves do not matter."""
    one = small_attitude_setup(1, frameskips=(20,), minibatch_size=64 * 16, passes=1)
    env_params = build.env_params(one)
    _, steps = fly(one, env_params, train_state.init(one, env_params, jax.random.key(0)))
    steps = jax.tree.map(np.asarray, steps)
    results = []
    for num_devices in (1, 2):
        setup = dataclasses.replace(one, num_devices=num_devices)
        state = train_state.init(setup, env_params, jax.random.key(0))
        optimize = functools.partial(on_samples, setup, env_params, state)
        results.append(jax.jit(optimize)(steps))
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-3, atol=1e-7), *results)


def on_samples(setup, env_params, state, steps):
    """Adam's moments after an update on given steps: the gradient, up to constant factors."""

    def on_device(state, steps):
        samples = ppo.with_advantages(setup, env_params, state, steps)
        return descent.optimize(
            setup.policy, setup.settings.ppo, state, samples, setup.num_devices
        )[0].optimizer

    split = PartitionSpec(None, sharding.AXIS)
    specs = (train_state.LEARNER_SPECS, split)
    return sharding.on_devices(setup.num_devices, on_device, specs, PartitionSpec())(state, steps)


def test_small_minibatches_are_not_shared_out():
    assert len(jax.devices()) == 2
    assert build.num_devices(presets.PRECISE) == 2
    assert build.num_devices(presets.PAPER_FAST) == 1
    assert build.num_devices(presets.PRECISE.replace(num_envs=2047)) == 1
