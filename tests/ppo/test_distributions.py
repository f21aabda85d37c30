"""What actions are drawn from, against SciPy's and NumPy's distributions."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from attjax import AttitudeEnv
from attjax.envs.observation import observe
from attjax.ppo.distributions import Categorical, Gaussian
from attjax.ppo.networks import Policy

MANY = 200_000
ENV = AttitudeEnv(frameskip=5, actions="continuous")
CONTEXT = ENV.context(ENV.default_params)


def some_gaussian(samples=4):
    rng = np.random.default_rng(0)
    mean, log_std = rng.normal(size=(2, 3, samples))
    return Gaussian(jnp.array(mean), jnp.array(log_std))


def test_density_and_entropy_of_a_gaussian(x64):
    gaussian = some_gaussian()
    action = np.random.default_rng(1).normal(size=(4, 3))
    reference = stats.norm(gaussian.mean.T, np.exp(gaussian.log_std.T))
    expected = reference.logpdf(action).sum(axis=1)
    np.testing.assert_allclose(gaussian.log_probability(jnp.array(action)), expected, rtol=1e-12)
    np.testing.assert_allclose(gaussian.entropy(), reference.entropy().sum(axis=1), rtol=1e-12)
    np.testing.assert_array_equal(gaussian.mode(), gaussian.mean.T)


def test_draws_of_a_gaussian_have_its_moments_axis_by_axis():
    one = Gaussian(jnp.array([[0.3], [-2.0], [0.0]]), jnp.log(jnp.array([[0.1], [1.0], [0.5]])))
    many = jax.tree.map(lambda x: jnp.broadcast_to(x, (3, MANY)), one)
    noise = Gaussian.noise(jax.random.key(0), (MANY,), jnp.float32)
    drawn = np.asarray(many.draw(noise))
    std = np.exp(one.log_std[:, 0])
    # Five standard deviations of a mean, and of a standard deviation.
    np.testing.assert_allclose(drawn.mean(axis=0), one.mean[:, 0], atol=5 * std.max() / MANY**0.5)
    np.testing.assert_allclose(drawn.std(axis=0), std, rtol=5 / (2 * MANY) ** 0.5)
    assert np.all(np.abs(np.corrcoef(drawn.T) - np.eye(3)) < 5 / MANY**0.5)


def test_greedy_samples_are_modes_and_the_others_are_not():
    greedy = np.array([True, False, False, True])
    gaussian = some_gaussian()
    noise = Gaussian.noise(jax.random.key(0), (4,), jnp.float32)
    is_mode = np.asarray(gaussian.draw(noise, greedy) == gaussian.mode())
    np.testing.assert_array_equal(is_mode, np.broadcast_to(greedy[:, None], (4, 3)))
    rare = Categorical(jnp.log(jnp.array([[0.9, 0.9], [0.1, 0.1]])))
    almost_one = jnp.full(2, 0.99)
    assert rare.draw(almost_one, np.array([True, False])).tolist() == [0, 1]


def test_outputs_are_the_mean_by_tanh_and_the_deviation_by_sigmoid():
    outputs = jnp.array([[9.0, 0.5], [0.0, -0.5], [-9.0, 0.0], [-1.0, 99], [-2.0, -99], [0, 0]])
    gaussian = Gaussian.of(outputs)
    np.testing.assert_allclose(gaussian.mean, np.tanh(outputs[:3]), rtol=1e-6)
    by_sigmoid = 1e-4 + 1 / (1 + np.exp(-np.asarray(outputs[3:], float)))
    np.testing.assert_allclose(np.exp(gaussian.log_std), by_sigmoid, rtol=1e-5)


@pytest.fixture(params=["discrete", "continuous"])
def policy_and_params(request):
    policy = Policy(hidden_sizes=(16,), actions=request.param)
    params = policy.init(*jax.random.split(jax.random.key(0)), observe_at_rest(), CONTEXT)
    return policy, jax.tree.map(lambda x: 3 * x, params)


def observe_at_rest():
    return observe(jnp.array([0.0, 0.0, 0.6, 0.8]), jnp.zeros(3))


def test_a_drawn_action_is_the_same_for_the_same_key_and_state_only(policy_and_params):
    policy, params = policy_and_params
    draw = jax.jit(policy.draw)
    keys, rates = jax.random.split(jax.random.key(1), 20), jnp.linspace(0, 0.1, 20)
    states = [observe_at_rest().at[9].set(rate) for rate in rates]
    first = [np.asarray(draw(params, keys[0], state, CONTEXT)) for state in states]
    again = [np.asarray(draw(params, keys[0], state, CONTEXT)) for state in states]
    np.testing.assert_array_equal(first, again)
    others = [np.asarray(draw(params, key, states[0], CONTEXT)) for key in keys]
    for drawn in (first, others):
        assert len(np.unique(np.array(drawn).reshape(20, -1), axis=0)) > 5


def test_actions_are_drawn_as_the_policy_says(policy_and_params):
    """At states that the network cannot tell apart, but the key can."""
    policy, params = policy_and_params
    nearby = 0.6 + 1e-7 * np.arange(4096)
    states = jnp.tile(observe_at_rest(), (4096, 1)).at[:, 2].set(nearby)
    distinct = len(np.unique(np.asarray(states[:, 2])))
    draw = jax.vmap(policy.draw, (None, 0, 0, None))
    keys = jax.random.split(jax.random.key(2), 4096)
    drawn = np.asarray(draw(params, keys, states, CONTEXT))
    inputs = jax.tree.map(lambda x: x[None], policy.encode(states[0], CONTEXT))
    distribution = policy.distribution(params, inputs)
    assert distinct > 1000
    if policy.actions == "continuous":
        deviation = (drawn - distribution.mode()) / np.exp(distribution.log_std.T)
        assert all(stats.kstest(column, "norm").pvalue > 1e-4 for column in deviation.T)
    else:
        frequency = np.bincount(drawn, minlength=19) / 4096
        expected = np.exp(distribution.log_probabilities[:, 0])
        np.testing.assert_allclose(frequency, expected, atol=5 * 0.5 / 4096**0.5)
