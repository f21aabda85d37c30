import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax.ppo import losses

pytestmark = pytest.mark.usefixtures("strict_promotion")


def column(*values, dtype=float):
    return jnp.array(values, dtype)[:, None]


def test_advantages_worked_by_hand():
    """γ = 0.5, λ = 0.5; step 1 truncates, step 3 terminates, the last one goes on."""
    advantages = losses.generalized_advantages(
        rewards=column(1, 2, 3, 4, 5),
        values=column(10, 20, 30, 40, 50),
        next_values=column(20, 24, 40, 99, 60),
        terminated=column(0, 0, 0, 1, 0, dtype=bool),
        done=column(0, 1, 0, 1, 0, dtype=bool),
        discount=0.5,
        gae_lambda=0.5,
    )[:, 0]
    # δ: 1+10-10 = 1;  2+12-20 = -6 (bootstrapped from its final state);
    #    3+20-30 = -7;  4-40 = -36 (no future);  5+30-50 = -15
    # Â: the recursion Â_t = δ_t + 0.25 Â_{t+1} stops where an episode is done
    np.testing.assert_allclose(advantages, [1 + 0.25 * -6, -6, -7 + 0.25 * -36, -36, -15])


@pytest.mark.parametrize("gae_lambda", [0.0, 0.7, 1.0])
def test_advantages_agree_with_a_loop(x64, gae_lambda):
    rng = np.random.default_rng(0)
    shape = (50, 7)
    rewards, values, next_values = rng.normal(size=(3, *shape))
    terminated, truncated = rng.random((2, *shape)) < 0.1
    done = terminated | truncated
    discount = rng.uniform(0.9, 1, 7)
    expected = np.zeros(shape)
    for n in range(7):
        advantage = 0.0
        for t in reversed(range(50)):
            future = 0.0 if terminated[t, n] else next_values[t, n]
            delta = rewards[t, n] + discount[n] * future - values[t, n]
            advantage = delta + (0.0 if done[t, n] else discount[n] * gae_lambda * advantage)
            expected[t, n] = advantage
    ours = losses.generalized_advantages(
        *map(jnp.array, (rewards, values, next_values, terminated, done, discount)), gae_lambda
    )
    np.testing.assert_allclose(ours, expected, atol=1e-13)


def test_lambda_1_is_return_minus_value(x64):
    """Eq. 5 on a complete episode, Eq. 2 summed directly."""
    rng = np.random.default_rng(1)
    rewards, values = rng.normal(size=(2, 100))
    done = np.zeros(100, bool)
    done[-1] = True
    returns = [sum(0.99**k * r for k, r in enumerate(rewards[t:])) for t in range(100)]
    ours = losses.generalized_advantages(
        *(jnp.array(x)[:, None] for x in (rewards, values, np.append(values[1:], 0), done, done)),
        0.99,
        1.0,
    )
    np.testing.assert_allclose(ours[:, 0], np.array(returns) - values, atol=1e-12)


@pytest.mark.parametrize(
    "ratio, advantage, objective",
    [
        (1.1, 2.0, 2.2),  # inside the clip range
        (1.5, 2.0, 2.4),  # gains beyond 1 + ε do not count
        (0.5, 2.0, 1.0),  # losses do
        (1.5, -2.0, -3.0),
        (0.5, -2.0, -1.6),
    ],
)
def test_clipped_objective(ratio, advantage, objective):
    """Eq. 4 with ε = 0.2."""
    loss, diagnostics = losses.clipped_policy_loss(
        jnp.log(jnp.array([ratio])), jnp.zeros(1), jnp.array([advantage]), 0.2
    )
    assert float(loss) == pytest.approx(-objective, rel=1e-5)
    assert float(diagnostics["clip_fraction"]) == (abs(ratio - 1) > 0.2)


def test_no_gradient_beyond_the_clip_range():
    def loss(log_ratio):
        return losses.clipped_policy_loss(log_ratio, jnp.zeros(1), jnp.ones(1), 0.2)[0]

    assert jax.grad(loss)(jnp.log(jnp.array([1.5])))[0] == 0
    assert jax.grad(loss)(jnp.log(jnp.array([0.5])))[0] != 0


def test_entropy_of_uniform_and_masked_distributions():
    uniform = jax.nn.log_softmax(jnp.zeros(19))
    assert float(losses.entropy(uniform)) == pytest.approx(np.log(19), rel=1e-6)
    masked = jax.nn.log_softmax(jnp.where(jnp.arange(19) < 4, 0.0, -1e9))
    assert float(losses.entropy(masked)) == pytest.approx(np.log(4), rel=1e-6)
    gradient = jax.grad(lambda x: losses.entropy(jax.nn.log_softmax(x)))(
        jnp.where(jnp.arange(19) < 4, 0.3 * jnp.arange(19.0), -1e9)
    )
    assert jnp.all(jnp.isfinite(gradient))


def test_standardize():
    x = losses.standardize(jnp.array([1.0, 2.0, 3.0, 10.0]))
    assert float(x.mean()) == pytest.approx(0, abs=1e-6)
    assert float(x.std()) == pytest.approx(1, rel=1e-6)


def test_zero_spread_is_not_divided_by(x64):
    """σ = 1e-8 as large as what is added to it: ±1e-8/(1e-8 + 1e-8)."""
    np.testing.assert_allclose(losses.standardize(jnp.array([-1e-8, 1e-8])), [-0.5, 0.5])


def test_policy_loss_and_its_diagnostics_worked_by_hand(x64):
    """Ratios 1.1, 1.5, 0.5 to old probabilities of ½, ε = 0.2: objectives 2.2, 2.4, −1.6."""
    old = np.log([0.5, 0.5, 0.5])
    new = np.log([0.55, 0.75, 0.25])
    loss, diagnostics = losses.clipped_policy_loss(new, old, jnp.array([2.0, 2.0, -2.0]), 0.2)
    assert float(loss) == pytest.approx(-1.0)
    assert float(diagnostics["clip_fraction"]) == pytest.approx(2 / 3)
    kl = np.mean([0.1 - np.log(1.1), 0.5 - np.log(1.5), -0.5 - np.log(0.5)])
    assert float(diagnostics["approximate_kl"]) == pytest.approx(kl)


def test_approximate_kl_has_the_mean_of_the_exact_one(x64):
    """Schulman's estimate over samples of the old policy, weighted by their probabilities."""
    old, new = np.array([0.5, 0.3, 0.2]), np.array([0.2, 0.2, 0.6])
    estimates = [
        losses.clipped_policy_loss(np.log(new[i : i + 1]), np.log(old[i : i + 1]), jnp.ones(1), 0.2)
        for i in range(3)
    ]
    mean = sum(p * float(x["approximate_kl"]) for p, (_, x) in zip(old, estimates))
    assert mean == pytest.approx(np.sum(old * np.log(old / new)))


def test_a_ratio_on_the_edge_is_not_clipped():
    _, diagnostics = losses.clipped_policy_loss(jnp.zeros(4), jnp.zeros(4), jnp.ones(4), 0.0)
    assert diagnostics["clip_fraction"] == 0


def test_pick_and_entropy_of_each_sample(x64):
    """Three actions, two samples."""
    probabilities = np.array([[0.5, 0.25], [0.25, 0.25], [0.25, 0.5]])
    log_probabilities = jnp.log(probabilities)
    picked = losses.pick(log_probabilities, jnp.array([2, 0]))
    np.testing.assert_allclose(picked, np.log([0.25, 0.25]))
    np.testing.assert_allclose(
        losses.pick(log_probabilities, jnp.array([0, 2])), np.log([0.5, 0.5])
    )
    np.testing.assert_allclose(losses.entropy(log_probabilities), [1.5 * np.log(2)] * 2)
