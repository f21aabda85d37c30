"""PPO's advantage estimate and losses, as plain functions of arrays."""

from collections.abc import Callable

import chex
import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array, Bool, Float, Integer, Real


def generalized_advantages(
    rewards: Float[Array | np.ndarray, "T *batch"],
    values: Float[Array | np.ndarray, "T *batch"],
    next_values: Float[Array | np.ndarray, "T *batch"],
    terminated: Bool[Array | np.ndarray, "T *batch"],
    done: Bool[Array | np.ndarray, "T *batch"],
    discount: Real[ArrayLike, "*#batch"],
    gae_lambda: float,
) -> Float[Array, "T *batch"]:
    """Generalised advantage estimates, right at terminations and at truncations.

    δ_t = r_t + γ (1 − terminated_t) V(s'_t) − V(s_t),
    Â_t = δ_t + γ λ (1 − done_t) Â_{t+1}.

    With λ = 1 this is Eq. 5: the return, bootstrapped where an episode was cut, minus V(s_t).

    Args:
        rewards, values, next_values: (T, ...) r_t, V(s_t) and V(s'_t), where s'_t is the
            state that step t led to, before any reset.
        terminated: (T, ...) bool, s'_t has no future.
        done: (T, ...) bool, the episode ended at step t, terminated or truncated.
        discount: γ, scalar or broadcastable to the trailing axes.
        gae_lambda: λ.

    Returns:
        (T, ...) advantages. Adding ``values`` gives the value function's targets.

    Reference:
        Schulman et al., High-dimensional continuous control using generalized advantage
        estimation, 2016.
    """
    chex.assert_equal_shape([rewards, values, next_values, terminated, done])
    deltas = rewards + discount * jnp.where(terminated, 0.0, next_values) - values
    decay = discount * gae_lambda * jnp.where(done, 0.0, 1.0).astype(rewards.dtype)

    def backward(advantage, step):
        delta, decay = step
        advantage = delta + decay * advantage
        return advantage, advantage

    _, advantages = jax.lax.scan(backward, jnp.zeros_like(deltas[0]), (deltas, decay), reverse=True)
    return advantages


def clipped_policy_loss(
    log_probability: Float[Array | np.ndarray, "batch"],
    old_log_probability: Float[Array | np.ndarray, "batch"],
    advantage: Float[Array | np.ndarray, "batch"],
    clip: float,
) -> tuple[Float[Array, ""], dict[str, Float[Array, ""]]]:
    """Eq. 4 with the sign of a loss, averaged over (batch,) arrays.

    Returns:
        The loss and {"approximate_kl", "clip_fraction"}.
    """
    log_ratio = log_probability - old_log_probability
    ratio = jnp.exp(log_ratio)
    objective = jnp.minimum(ratio * advantage, jnp.clip(ratio, 1 - clip, 1 + clip) * advantage)
    diagnostics = {
        "approximate_kl": jnp.mean(ratio - 1 - log_ratio),
        "clip_fraction": jnp.mean((jnp.abs(ratio - 1) > clip).astype(ratio.dtype)),
    }
    return -jnp.mean(objective), diagnostics


def pick(
    log_probabilities: Float[Array | np.ndarray, "actions samples"],
    action: Integer[Array | np.ndarray, "samples"],
) -> Float[Array, "samples"]:
    """(samples,) log probability of each taken action, from those of all (actions, samples).

    A masked sum: gathers and their gradients, scatters, do not vectorise.
    """
    is_taken = jnp.arange(len(log_probabilities))[:, None] == action
    return jnp.sum(jnp.where(is_taken, log_probabilities, 0.0), axis=0)


def entropy(
    log_probabilities: Float[Array | np.ndarray, "actions *samples"],
) -> Float[Array, "*samples"]:
    """(samples,) entropy, nats, of categorical distributions (actions, samples); () of one."""
    return -jnp.sum(jnp.exp(log_probabilities) * log_probabilities, axis=0)


def standardize(
    x: Float[Array | np.ndarray, "*shape"], mean: Callable[[Array | np.ndarray], Array] = jnp.mean
) -> Float[Array, "*shape"]:
    """Shift and scale to mean 0 and standard deviation 1, as ``mean`` averages."""
    centred = x - mean(x)
    return jnp.divide(centred, jnp.sqrt(mean(centred**2)) + 1e-8)
