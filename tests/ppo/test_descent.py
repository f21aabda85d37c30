"""The gradient steps of an update, against NumPy and the formulas written out anew."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from descents import new_learner, optimized, random_samples, small_setup
from jax.flatten_util import ravel_pytree

from attjax.ppo import descent

WEIGHTS = descent.LossWeights(clip=0.2, entropy=0.0)


def written_out_loss(params, samples, advantage, clip, entropy_weight):
    """Eq. 4, the entropy bonus and the mean squared error, sample by sample, and its metrics."""

    def network(params, x):
        layers = params["params"]
        x = jnp.maximum(x @ layers["Dense_0"]["kernel"] + layers["Dense_0"]["bias"], 0)
        return x @ layers["Dense_1"]["kernel"] + layers["Dense_1"]["bias"]

    logits = network(params["policy"], samples.inputs.features)
    probabilities = jnp.exp(logits) / jnp.sum(jnp.exp(logits), axis=1, keepdims=True)
    taken = probabilities[jnp.arange(len(samples.action)), samples.action]
    ratio = taken / jnp.exp(samples.log_probability)
    bounded = jnp.minimum(jnp.maximum(ratio, 1 - clip), 1 + clip)
    gain = jnp.mean(jnp.minimum(ratio * advantage, bounded * advantage))
    entropy = -jnp.mean(jnp.sum(probabilities * jnp.log(probabilities), axis=1))
    miss = network(params["value"], samples.inputs.features)[:, 0] - samples.target
    metrics = {
        "policy_loss": -gain,
        "value_loss": jnp.mean(miss**2),
        "entropy": entropy,
        "explained_variance": 1 - jnp.var(miss) / jnp.var(samples.target),
    }
    return -gain - entropy_weight * entropy + jnp.mean(miss**2), metrics


@pytest.mark.parametrize("normalize, max_norm", [(True, 0.05), (False, 0.0)])
def test_a_gradient_step_is_adams_along_the_loss_written_out(x64, normalize, max_norm):
    """All samples in one minibatch; Adam's first moment is a tenth of the gradient, clipped."""
    setup = small_setup(
        minibatch_size=128,
        passes=1,
        normalize_advantage=normalize,
        max_gradient_norm=max_norm,
        entropy_coefficient=0.4,
        final_entropy_coefficient=0.1,
    )
    samples = random_samples(128)
    before, after, metrics = optimized(setup, samples, update=1)
    advantage = np.asarray(samples.advantage)
    if normalize:
        advantage = (advantage - advantage.mean()) / advantage.std()
    gradients, expected = jax.grad(written_out_loss, has_aux=True)(
        before.params, samples, advantage, setup.settings.ppo.clip, 0.3
    )
    for name, gradient in gradients.items():
        gradient, _ = ravel_pytree(gradient)
        norm = float(jnp.linalg.norm(gradient))
        assert norm > 0.05
        if max_norm:
            gradient = gradient * max_norm / norm
        adam = after.optimizer[name][1][0]
        first, second = (ravel_pytree(x)[0] for x in (adam.mu, adam.nu))
        np.testing.assert_allclose(first, 0.1 * gradient, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(second, 0.001 * gradient**2, rtol=1e-6, atol=1e-15)
        moved = [ravel_pytree(x.params[name])[0] for x in (before, after)]
        step = setup.settings.ppo.learning_rate * gradient / (abs(gradient) + 1e-8)
        np.testing.assert_allclose(moved[0] - moved[1], step, rtol=1e-6, atol=1e-12)
    for name, value in expected.items():
        assert float(metrics[name]) == pytest.approx(float(value), rel=1e-6), name


def test_explained_variance_of_a_constant_target():
    """1 − Var(residual)/(0 + 1e-12), finite: a value that is constant too explains all."""
    setup = small_setup()
    params = new_learner(setup).params
    samples = random_samples(4)
    inputs = samples.inputs.replace(features=jnp.ones((4, 11)))
    constant = samples.replace(target=jnp.ones(4), inputs=inputs)
    _, metrics = descent.loss(setup.policy, params, constant, WEIGHTS)
    assert float(metrics["explained_variance"]) == pytest.approx(1, abs=1e-2)
    _, metrics = descent.loss(setup.policy, params, samples.replace(target=jnp.ones(4)), WEIGHTS)
    assert -np.inf < float(metrics["explained_variance"]) < -1e6  # a value that is not
