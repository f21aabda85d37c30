import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv
from attjax.envs import observation
from attjax.ppo.networks import Inputs, Policy

pytestmark = pytest.mark.usefixtures("strict_promotion")

ENV = AttitudeEnv(frameskip=5)
CONTEXT = ENV.context(ENV.default_params)


def observe(angular_velocity, quaternion=(0.0, 0.0, 0.0, 1.0)):
    return observation.observe(jnp.array(quaternion), jnp.array(angular_velocity, float))


def parameters(policy, seed=0):
    keys = jax.random.split(jax.random.key(seed))
    return policy.init(*keys, observe([0, 0, 0]), CONTEXT)


def test_sizes_are_table_3():
    params = parameters(Policy())
    for name, outputs in (("policy", 19), ("value", 1)):
        kernels = [layer["kernel"].shape for layer in params[name]["params"].values()]
        assert kernels == [(11, 400), (400, 300), (300, outputs)]
    assert hash(Policy()) == hash(Policy())  # a static argument


def test_layers_begin_orthogonal_and_without_bias(x64):
    """√2 times orthogonal before a ReLU; 0.01 times for logits, so that all actions are likely."""
    params = parameters(Policy(hidden_sizes=(8, 5), num_actions=3))
    for name, last in (("policy", 0.01), ("value", 1.0)):
        layers = params[name]["params"]
        for layer, scale in zip(layers.values(), (2**0.5, 2**0.5, last)):
            singular = np.linalg.svd(layer["kernel"], compute_uv=False)
            np.testing.assert_allclose(singular, scale)
            assert not layer["bias"].any()
        assert len(layers) == 3


def test_uniform_layers_begin_as_those_of_pytorch(x64):
    """Kernel and bias uniform within 1/√inputs, whatever the layer."""
    params = parameters(Policy(hidden_sizes=(64, 300), initial_weights="uniform"))
    for network in params.values():
        for layer in network["params"].values():
            bound = len(layer["kernel"]) ** -0.5
            for x in layer.values():
                assert np.abs(x).max() <= bound
                if x.size > 100:
                    assert np.std(x) == pytest.approx(bound / 3**0.5, rel=0.1)
                    assert abs(np.mean(x)) < 5 * bound / 3**0.5 / x.size**0.5


def test_the_papers_policy_sees_the_observation_and_masks_nothing():
    observed = observe([0.6, 0.5, -0.4], (0.1, -0.7, 0.5, 0.5))
    inputs = Policy().encode(observed, CONTEXT)
    np.testing.assert_array_equal(inputs.features, observed)
    assert inputs.allowed.shape == (19,) and inputs.allowed.all() and Policy().rate_margin == 0
    assert not Policy(rate_margin=1e-3).encode(observed, CONTEXT).allowed.all()


def test_values_and_masked_probabilities_written_out(x64):
    """With one hidden layer, in NumPy; a masked action has no part of the sum."""
    policy = Policy(hidden_sizes=(6,), num_actions=4)
    params = jax.tree.map(lambda x: x + 0.1, parameters(policy))  # biases too
    x = np.random.default_rng(3).normal(size=(5, 11))
    allowed = np.array([[1, 0, 1, 1], [1, 1, 1, 1], [0, 0, 1, 0], [1, 1, 0, 0], [0, 1, 0, 1]], bool)

    def network(name):
        first, last = (params[name]["params"][f"Dense_{i}"] for i in range(2))
        hidden = np.maximum(x @ np.asarray(first["kernel"]) + np.asarray(first["bias"]), 0)
        return hidden @ np.asarray(last["kernel"]) + np.asarray(last["bias"])

    np.testing.assert_allclose(policy.value(params, x), network("value")[:, 0])
    inputs = Inputs(jnp.array(x), jnp.array(allowed))
    weights = np.exp(network("policy")) * allowed
    expected = weights / weights.sum(axis=1, keepdims=True)
    probabilities = np.exp(policy.distribution(params, inputs).log_probabilities)
    np.testing.assert_allclose(probabilities, expected.T, atol=1e-15)
    for row, most in enumerate(expected.argmax(axis=1)):
        assert np.asarray(policy.outputs(params, inputs))[:, row].argmax() == most


def batch_of_one(inputs):
    return jax.tree.map(lambda x: x[None], inputs)


def test_networks_map_each_sample_to_a_column():
    """Against the layers written out in NumPy."""
    policy = Policy(hidden_sizes=(5, 7))
    params = parameters(policy)
    features = np.random.default_rng(0).normal(size=(4, 11)).astype(np.float32)
    layers = [params["policy"]["params"][f"Dense_{i}"] for i in range(3)]
    x = features
    for index, layer in enumerate(layers):
        x = x @ np.asarray(layer["kernel"]) + np.asarray(layer["bias"])
        x = np.maximum(x, 0) if index < 2 else x
    expected = x - np.log(np.exp(x).sum(axis=1, keepdims=True))
    inputs = Inputs(features, np.ones((4, 19), bool))
    np.testing.assert_allclose(
        policy.distribution(params, inputs).log_probabilities, expected.T, rtol=1e-5
    )
    assert policy.value(params, features).shape == (4,)


def test_masked_actions_are_never_taken():
    policy = Policy(rate_margin=0.9, hidden_sizes=(8,))
    params = parameters(policy)
    inputs = policy.encode(observe([0.449, 0, 0]), CONTEXT)
    assert not inputs.allowed[1] and inputs.allowed[2]
    log_probabilities = policy.distribution(params, batch_of_one(inputs)).log_probabilities[:, 0]
    assert float(jnp.exp(log_probabilities).sum()) == pytest.approx(1, rel=1e-5)
    assert jnp.exp(log_probabilities[1]) == 0
    actions = jax.random.categorical(jax.random.key(0), log_probabilities, shape=(10_000,))
    assert inputs.allowed[actions].all()
    assert inputs.allowed[policy.act(params, observe([0.449, 0, 0]), CONTEXT)]


def test_act_is_the_most_probable_action_at_any_rate():
    policy = Policy(features="multiscale", hidden_sizes=(16,))
    params = parameters(policy)
    for frameskip in (5, 20):
        env = AttitudeEnv(frameskip)
        context = env.context(env.default_params)
        inputs = policy.encode(observe([0.1, 0.2, 0.0]), context)
        expected = jnp.argmax(policy.distribution(params, batch_of_one(inputs)).log_probabilities)
        assert policy.act(params, observe([0.1, 0.2, 0.0]), context) == expected


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_a_batch_decides_as_each_by_itself(actions):
    """Whatever is batched: observations, contexts, parameters, keys."""
    policy = Policy(features="multiscale", hidden_sizes=(16,), actions=actions)
    kinds = [parameters(policy), jax.tree.map(lambda x: x[..., ::-1], parameters(policy))]
    states = jax.random.normal(jax.random.key(1), (5, 11))
    keys = jax.random.split(jax.random.key(2), 5)
    contexts = [CONTEXT, CONTEXT.replace(control_period=CONTEXT.control_period / 2)]
    both = jax.tree.map(lambda *x: jnp.stack(x), *contexts)
    together = jax.vmap(policy.act, (None, 0, None))(kinds[0], states, CONTEXT)
    drawn = jax.vmap(policy.draw, (None, 0, 0, None))(kinds[0], keys, states, CONTEXT)
    for i in range(5):
        np.testing.assert_allclose(together[i], policy.act(kinds[0], states[i], CONTEXT), rtol=1e-5)
        one = policy.draw(kinds[0], keys[i], states[i], CONTEXT)
        np.testing.assert_allclose(drawn[i], one, rtol=1e-5)
    at_two_rates = jax.vmap(policy.act, (None, None, 0))(kinds[0], states[0], both)
    of_two = jax.vmap(policy.act, (0, None, None))(
        jax.tree.map(lambda *x: jnp.stack(x), *kinds), states[0], CONTEXT
    )
    for i in range(2):
        one = policy.act(kinds[0], states[0], contexts[i])
        np.testing.assert_allclose(at_two_rates[i], one, rtol=1e-5)
        one = policy.act(kinds[i], states[0], CONTEXT)
        np.testing.assert_allclose(of_two[i], one, rtol=1e-5)


def test_a_continuous_action_has_gradients():
    """In reverse too, which the batched form by itself has none of."""
    policy = Policy(features="state", hidden_sizes=(16,), actions="continuous")
    params, states = parameters(policy), jax.random.normal(jax.random.key(1), (3, 11))

    def torque(states):
        return jax.vmap(policy.act, (None, 0, None))(params, states, CONTEXT)[:, 0].sum()

    found, nudge = jax.grad(torque)(states), jnp.zeros((3, 11)).at[1, 4].set(1e-2)
    slope = (torque(states + nudge) - torque(states - nudge)) / 2e-2
    assert found[1, 4] == pytest.approx(float(slope), rel=2e-2)


def test_networks_follow_the_default_float_type(x64):
    policy = Policy(features="multiscale", hidden_sizes=(8,))
    context = ENV.context(ENV.default_params)
    params = policy.init(*jax.random.split(jax.random.key(0)), observe([0, 0, 0]), context)
    assert {x.dtype for x in jax.tree.leaves(params)} == {jnp.dtype("float64")}
