"""The inputs of a policy that flies any spacecraft, and the decisions that are made of them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from helpers.own_units import KINDS, PULSES, SKEW, TENSOR, context_of, renamed

from attjax import LM50, AttitudeEnv, Spacecraft
from attjax.control import torque_order, universal
from attjax.control.own_units import OwnUnits
from attjax.envs import observation
from attjax.export.flight_policy import FlightPolicy
from attjax.export.provenance import Origin
from attjax.ppo.networks import Policy


@KINDS
def test_names_of_axes_change_nothing(craft):
    """Inputs and the torque decided on are the same to the last bit but for -0."""
    policy = Policy("universal", (8,), torque_order.ACTIONS, 0.99)
    state = observation.observe(jnp.array([0.3, -0.2, 0.4, 0.84]), jnp.array([0.02, -0.03, 0.01]))
    params = policy.init(jax.random.key(1), jax.random.key(2), state, context_of(craft))
    params["policy"]["params"]["Dense_1"]["kernel"] *= 100  # decisions that depend on the state
    seen, torques = [], []
    features, act = jax.jit(universal.universal_features), jax.jit(policy.act)
    for same in renamed(craft):
        context = context_of(same)
        seen.append(features(state, context))
        torques.append(context.torque_table[act(params, state, context)])
    assert len(np.unique(np.array(seen) + 0.0, axis=0)) == 1
    assert len(np.unique(np.array(torques) + 0.0, axis=0)) == 1 and np.any(torques[0])


@pytest.mark.parametrize("axis", range(3))
def test_a_half_turn_of_a_body_in_its_principal_axes_turns_the_decision(x64, axis):
    """Gyroscopic torques among them: what is seen is the same, and what is decided is turned."""
    context = context_of(LM50)
    policy = Policy("universal", (8,), torque_order.ACTIONS, 0.99)
    turn = -np.ones(3)
    turn[axis] = 1
    vector, rate = jnp.array([0.3, -0.2, 0.4]), jnp.array([0.02, -0.03, 0.01])
    state, turned = (
        observation.observe(jnp.append(s * vector, 0.84), s * rate) for s in (np.ones(3), turn)
    )
    params = policy.init(jax.random.key(1), jax.random.key(2), state, context)
    params["policy"]["params"]["Dense_1"]["kernel"] *= 100
    seen, same = (universal.universal_features(x, context) for x in (state, turned))
    np.testing.assert_array_equal(seen + 0.0, same + 0.0)
    torque, other = (context.torque_table[policy.act(params, x, context)] for x in (state, turned))
    assert np.any(torque)
    np.testing.assert_array_equal(turn * torque + 0.0, other + 0.0)


def test_axes_that_were_identified_to_be_weak_or_dead_are_seen(x64):
    """An impulse still adds one about its axis, whatever its size; a dead axis is the last."""
    context, most = context_of(PULSES), float(context_of(PULSES).largest_torque)
    policy = Policy("universal", (8,), torque_order.ACTIONS, 0.99)
    for gains in ((1, 0.5, 0.8), (1, 0.03, 0.8), (0, 0.5, 1), (1, 0, 0.5), (1, 0.5, 0.01)):
        table = context.torque_table * np.array(gains)  # PULSES has torques along the body axes
        weak = torque_order.ordered(dataclasses.replace(context, torque_table=table))
        state = observation.observe(jnp.array([0.3, -0.2, 0.4, 0.84]), jnp.full(3, 0.02))
        seen, units = universal.universal_features(state, weak), OwnUnits.of(weak)
        assert np.all(np.isfinite(seen))
        impulse, is_dead = weak.torque_table[1:7:2] * weak.torque_duration, min(gains) < 0.02
        flag = universal.CONSTANTS - universal.HAND - 1  # the place after that of the hand
        assert seen[-flag] == units.is_crippled == is_dead
        if is_dead:
            impulse = impulse.at[2].set(0).at[2, np.argmin(gains)].set(most * weak.torque_duration)
            impulse = impulse * units.hand
        gained = units.momentum @ np.linalg.solve(weak.inertia, impulse.T)
        np.testing.assert_allclose(np.abs(gained), np.eye(3), atol=1e-9)
        allowed = policy.encode(state, weak).allowed
        about_last = np.arange(1, torque_order.ACTIONS).reshape(3, 3, 2)[:, 2].ravel()
        assert np.all(allowed[about_last] == (not is_dead))
        assert np.all(np.delete(allowed, about_last))


@pytest.mark.parametrize("way", [1, -1])
@KINDS
def test_universal_features_written_out(x64, craft, way):
    context = torque_order.ordered(context_of(craft, 11))
    units, h, d = OwnUnits.of(context), 0.05, float(context.torque_duration)
    q, w = np.array([0.3 * way, -0.25 * way, 4e-6, 0.9]), np.array([0.2, -1e-4, 3e-7])
    p, axes, shape = (np.asarray(x) for x in (units.momentum, units.directions, units.shape))
    z = p @ (2 * q[:3]) / h + p @ w * d / (2 * h)
    sign = np.where(z < 0, -1, 1)
    assert way == 1 or np.any(sign < 0)
    x = np.concatenate([abs(z) / np.sqrt(1 + abs(z)), sign * (p @ w)])
    moments = np.diagonal(shape)
    slew = x / np.tile(np.sqrt(moments / h), 2)
    expected = [np.tanh(4.0**n * component) for n in range(-5, 4) for component in x]
    expected += [np.tanh(k * component) for k in (0.5, 1, 2, 4) for component in slew]
    expected += [*sign * (axes @ q[:3]), q[3], *sign * (axes @ w) / craft.rate_limit]
    expected += [*(np.log(moments / h) / 2 - 3)]
    expected += [
        sign[i] * sign[j] * shape[i, j] / np.sqrt(moments[i] * moments[j])
        for i, j in ((0, 1), (0, 2), (1, 2))
    ]
    expected += [*(np.log(craft.rate_limit * moments) / 2 - 2.25)]
    levels = np.array(craft.torque_levels)
    expected += [*(np.log(levels[1:] / levels[0]) / 4 + 0.5), d / h, np.log(10 * h)]
    expected += [np.prod(sign) * np.linalg.det(axes) / abs(np.linalg.det(axes)), 0]
    torque = np.array([1e-4, -3e-4, 2e-5])
    push = np.linalg.solve(axes.T, torque) * h / (np.max(craft.torque_levels) * d)
    expected += [np.tanh(k * component) for k in (4, 32, 256) for component in sign * push]
    observed = jnp.concatenate([q, np.full(4, 7.0), w])  # q̇ is not looked at
    context = dataclasses.replace(context_of(craft, 11), disturbance=jnp.asarray(torque))
    found = universal.universal_features(observed, context)
    assert found.shape == (109,)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_features_of_a_large_batch_are_those_of_small_ones():
    """jaxlib 0.10.2 adds up rows beyond 2¹⁵ numbers wrongly on a CPU."""
    rng = np.random.default_rng(0)
    quaternion, rate = rng.normal(size=(12_000, 4)), rng.normal(0, 0.1, (12_000, 3))
    observations = np.concatenate([quaternion, np.zeros((12_000, 4)), rate], axis=1)
    observations = jnp.asarray(observations, jnp.float32)
    context = context_of(LM50)
    policy = Policy("universal", (8,), torque_order.ACTIONS, 0.99)
    encode = jax.jit(jax.vmap(lambda x: policy.encode(x, context)))
    whole = encode(observations)
    parts = [encode(observations[n : n + 300]) for n in range(0, 12_000, 300)]
    np.testing.assert_allclose(
        whole.features, np.concatenate([x.features for x in parts]), atol=1e-5
    )
    differing = whole.allowed != np.concatenate([x.allowed for x in parts])
    assert np.sum(differing) <= 2  # at the very limit


def test_an_export_is_of_torques_in_order():
    env = AttitudeEnv(5)
    policy = Policy("universal", (8,), torque_order.ACTIONS, 0.99)
    state = observation.observe(jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3))
    keys = jax.random.split(jax.random.key(0))
    params = policy.init(*keys, state, env.context(env.default_params))
    with pytest.raises(ValueError, match="LM50 has torques in another order than the policy"):
        FlightPolicy(policy, params, env, Origin("no training"))
    FlightPolicy(
        policy, params, AttitudeEnv(5, spacecraft=torque_order.in_order(LM50)), Origin("no")
    )


def test_scores_are_of_the_rows_of_the_table_and_the_best_is_what_is_done():
    """For an assurance, of any number of levels; what is none of its actions is the last choice."""
    policy = Policy("universal", (8,), torque_order.ACTIONS, 0.99)
    crafts = LM50, SKEW, Spacecraft(torque_levels=(0.3, 0.001, 0.2, 0.02, 0.002), inertia=TENSOR)
    rng = np.random.default_rng(0)
    for craft in (*crafts, Spacecraft(torque_levels=(0.4,))):
        context = context_of(craft)
        keys = jax.random.split(jax.random.key(0))
        params = policy.init(*keys, jnp.zeros(11).at[3].set(1), context)
        params = jax.tree.map(lambda x: x + jnp.asarray(rng.normal(size=x.shape), x.dtype), params)
        score, act = jax.jit(policy.scores), jax.jit(policy.act)
        for rate in rng.normal(0, 0.1, (20, 3)):
            told = observation.observe(jnp.asarray(rng.normal(size=4) / 2), jnp.asarray(rate))
            scores = score(params, told, context)
            assert scores.shape == (len(context.torque_table),)
            assert int(jnp.argmax(scores)) == int(act(params, told, context))
        others = np.setdiff1d(np.arange(len(scores)), torque_order.rows(context))
        assert np.all(np.isfinite(scores)) and np.all(scores[others] < -1.5e9)
