import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, rotated_inertia

from attjax import AttitudeEnv, dynamics, networks, observation, rigid_body, spacecraft
from attjax.networks import Inputs, Policy

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
    probabilities = np.exp(policy.log_probabilities(params, inputs))
    np.testing.assert_allclose(probabilities, expected.T, atol=1e-15)
    for row, most in enumerate(expected.argmax(axis=1)):
        assert np.asarray(policy.logits(params, inputs))[:, row].argmax() == most


def test_multiscale_features_resolve_every_decade():
    """A change of 1 % at any distance from the goal moves some feature by 1e-3 or more."""
    for magnitude in 10.0 ** np.arange(-6, 0):
        a = networks.multiscale_features(observe([magnitude, 0, 0]), CONTEXT)
        b = networks.multiscale_features(observe([1.01 * magnitude, 0, 0]), CONTEXT)
        assert a.shape == (57,)
        assert float(jnp.abs(a - b).max()) > (1e-3 if magnitude > 1e-5 else 1e-4)
        assert float(jnp.abs(a).max()) <= 3


def test_multiscale_features_make_the_last_stretch_the_same_at_every_rate():
    """Half the period at half the distance: the same ω brings it there in as many actions."""
    rate = [2e-5, -1e-5, 3e-5]
    contexts = [CONTEXT.replace(control_period=jnp.array(x)) for x in (0.0875, 0.04375)]
    slow = networks.multiscale_features(observe(rate, (2e-5, 4e-5, -6e-5, 1.0)), contexts[0])
    fast = networks.multiscale_features(observe(rate, (1e-5, 2e-5, -3e-5, 1.0)), contexts[1])
    np.testing.assert_allclose(slow[:-2], fast[:-2], rtol=1e-6)


@pytest.mark.parametrize("period", [0.1, 0.025])
def test_multiscale_features_written_out(x64, period):
    """tanh(4ⁿ x) scale by scale, then q_s, the period in 0.1 s and its logarithm."""
    context = CONTEXT.replace(control_period=jnp.array(period))
    q, w = np.array([0.3, -2e-3, 4e-6, 0.9]), np.array([0.2, -1e-4, 3e-7])
    x = np.concatenate([q[:3] * 0.05 / period, w])
    expected = [np.tanh(4.0**n * component) for n in range(9) for component in x]
    expected += [q[3], period / 0.1, np.log(period / 0.1)]
    observed = jnp.concatenate([q, np.full(4, 7.0), w])  # q̇ is not looked at
    np.testing.assert_allclose(networks.multiscale_features(observed, context), expected)
    wrong = r"observation has shape \(10,\); it must be \(11,\)"
    with pytest.raises(ValueError, match=wrong):
        networks.multiscale_features(observed[:10], context)


@pytest.mark.parametrize("duration", [1 / 240, 0.1], ids=["pulse", "held"])
def test_mask_removes_exactly_the_actions_that_lead_beyond_the_limit(x64, duration):
    """0.45 rad/s by a forecast of first order, 0.475 by an upper bound."""
    rng = np.random.default_rng(0)
    context = ENV.context(ENV.default_params).replace(torque_duration=duration)
    change = np.asarray(context.torque_table) / np.asarray(context.inertia) * duration
    form = [1, 1, 0.797 * (0.872 + 0.115 - 0.797) / (0.872 * 0.115)]
    growth = np.sqrt(change**2 @ form)
    turning = 0.5**0.5 * duration * growth
    turning = turning * (0.475**2 + 2 / 3 * 0.475 * growth + growth**2 / 6)
    limited = 0
    for _ in range(200):
        w = rng.normal(size=3)
        w *= rng.uniform(0.40, 0.52) / np.linalg.norm(w)
        before, after = w**2 @ form, (w + change) ** 2 @ form
        expected = (after <= 0.45**2) & (after + turning <= 0.475**2)
        expected |= (after + turning < before) | (np.arange(19) == 0)
        ours = networks.rate_mask(observe(w), context, 0.9)
        np.testing.assert_array_equal(ours, expected)
        limited += not expected.all()
    assert limited > 50


@pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
@pytest.mark.parametrize("duration", [0.003, 0.5], ids=["below", "beyond the middle"])
def test_mask_constants_written_out(x64, inertia, duration):
    """For a spacecraft at rest a weak torque and one that passes the limit at once."""
    torques = np.array([[0.0, 0, 0], [0.5, 0.2, -0.9], [0, -0.3, 0]])
    context = CONTEXT.replace(
        inertia=jnp.asarray(inertia),
        torque_table=jnp.asarray(torques),
        torque_duration=duration,
        rate_limit=jnp.array(0.5),
    )
    tensor = np.diag(inertia) if inertia.ndim == 1 else inertia
    low, _, high = np.sort(LM50)
    form = ((low + high) * tensor - tensor @ tensor) / (low * high)
    change = torques @ np.linalg.inv(tensor) * duration
    growth = np.sqrt(np.einsum("ai,ij,aj->a", change, form, change))
    turning = np.sqrt(1 / 2) * duration * growth
    turning = turning * (0.4**2 + 2 / 3 * 0.4 * growth + growth**2 / 6)
    allowed = np.minimum(0.3**2 + turning, 0.4**2)  # with a margin of 0.6: 0.3, in the middle 0.4
    ours = networks.rate_mask_constants(context, 0.6)
    for x, expected in zip(ours, (form, change, growth**2 + turning, allowed), strict=True):
        np.testing.assert_allclose(x, expected, rtol=1e-12, atol=1e-15)


def test_mask_at_its_very_edges(x64):
    """A sphere at rest, whose rate a torque held for 0.5 s brings to just what the mask keeps."""
    torques = jnp.array([[0.0, 0, 0], [1.0, 0, 0], [1.0 + 1e-12, 0, 0], [1e-200, 0, 0]])
    context = CONTEXT.replace(
        inertia=jnp.ones(3), torque_table=torques, torque_duration=0.5, rate_limit=jnp.array(1.0)
    )
    assert networks.rate_mask(observe([0, 0, 0]), context, 0.5).tolist() == [1, 1, 0, 1]
    # Beyond the limit, a torque that is lost in rounding lowers nothing.
    assert networks.rate_mask(observe([0, 2, 0]), context, 0.5).tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize("frameskip", [0, 5, 20])
@pytest.mark.parametrize("reckless", [True, False], ids=["fastest", "random"])
def test_no_policy_under_the_mask_passes_the_limit(frameskip, reckless):
    """64 spacecraft that spin up as far as the mask lets them, or act at random."""
    env, margin = AttitudeEnv(frameskip), 0.99
    params = env.default_params
    context = env.context(params)

    def step(state, key):
        observed = observation.observe(state.quaternion, state.angular_velocity)
        allowed = networks.rate_mask(observed, context, margin)
        wish = jax.random.uniform(key, (19,))
        if reckless:
            after = dynamics.rate_after_impulse(
                state.angular_velocity, context.torque_table, context.inertia
            )
            wish = rigid_body.peak_rate(after, context.inertia) + 1e-3 * wish
        state = spacecraft.step(
            state, jnp.argmax(jnp.where(allowed, wish, -1.0)), params, frameskip
        )
        return state, jnp.sqrt(jnp.sum(state.angular_velocity**2))

    def highest_rate(key):
        start = spacecraft.initial_state(key, params)
        return jnp.max(jax.lax.scan(step, start, jax.random.split(key, 1750))[1])

    rates = jax.jit(jax.vmap(highest_rate))(jax.random.split(jax.random.key(1), 64))
    assert rates.max() <= margin * params.rate_limit * (1 + 1e-5)
    if reckless:
        assert rates.max() > 0.985 * params.rate_limit


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
    np.testing.assert_allclose(policy.log_probabilities(params, inputs), expected.T, rtol=1e-5)
    assert policy.value(params, features).shape == (4,)


def test_masked_actions_are_never_taken():
    policy = Policy(rate_margin=0.9, hidden_sizes=(8,))
    params = parameters(policy)
    inputs = policy.encode(observe([0.449, 0, 0]), CONTEXT)
    assert not inputs.allowed[1] and inputs.allowed[2]
    log_probabilities = policy.log_probabilities(params, batch_of_one(inputs))[:, 0]
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
        expected = jnp.argmax(policy.log_probabilities(params, batch_of_one(inputs)))
        assert policy.act(params, observe([0.1, 0.2, 0.0]), context) == expected


def test_networks_follow_the_default_float_type(x64):
    policy = Policy(features="multiscale", hidden_sizes=(8,))
    context = ENV.context(ENV.default_params)
    params = policy.init(*jax.random.split(jax.random.key(0)), observe([0, 0, 0]), context)
    assert {x.dtype for x in jax.tree.leaves(params)} == {jnp.dtype("float64")}
