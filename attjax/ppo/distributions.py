"""What a policy draws its actions from: categorical over a table, or Gaussian over torques.

Their parameters have a column for each sample, as the networks' outputs do.
"""

import math

import chex
import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax.dynamics.numerics import matmul
from attjax.ppo import losses

LEAST_STD = 1e-4
"""What a Gaussian's standard deviation stays above, so that its density can be worked with."""


@struct.dataclass
class Categorical:
    """Actions (samples,), integers.

    Attributes:
        log_probabilities: (actions, samples).
    """

    log_probabilities: chex.Array

    @classmethod
    def of(cls, outputs: chex.Array) -> "Categorical":
        """Of a network's (actions, samples) outputs: LogSoftmax (Table 3)."""
        return cls(nn.log_softmax(outputs, axis=0))

    @staticmethod
    def noise(key: chex.PRNGKey, shape: tuple[int, ...], dtype: jnp.dtype) -> chex.Array:
        """What :meth:`draw` needs: one random number from [0, 1) a sample.

        The Gumbel trick takes one an action and costs more than the physics.
        """
        return jax.random.uniform(key, shape, dtype)

    def draw(self, noise: chex.Array, greedy: np.ndarray | bool = False) -> chex.Array:
        """Random actions, by inversion of the cumulative probabilities; the mode where greedy.

        Masked actions are never drawn, and always some action is: the threshold stays a
        millionth below the sum, whatever the rounding.
        """
        probabilities = jnp.exp(self.log_probabilities)
        up_to = np.tri(len(probabilities), dtype=probabilities.dtype)
        cumulative = matmul(up_to, probabilities)
        threshold = noise * (1 - 1e-6) * cumulative[-1]
        drawn = _first_row((cumulative > threshold) & (probabilities > 0))
        return jnp.where(greedy, self.mode(), drawn)

    @staticmethod
    def mode_of(outputs: chex.Array) -> chex.Array:
        """The most probable actions, of a network's (actions, samples) outputs."""
        return _first_row(outputs == jnp.max(outputs, axis=0))

    def mode(self) -> chex.Array:
        """The most probable actions."""
        return self.mode_of(self.log_probabilities)

    def log_probability(self, action: chex.Array) -> chex.Array:
        """(samples,) of each sample's action."""
        return losses.pick(self.log_probabilities, action)

    def entropy(self) -> chex.Array:
        """(samples,) nats."""
        return losses.entropy(self.log_probabilities)


@struct.dataclass
class Gaussian:
    """Actions (samples, axes), real: each axis by itself, and none bounded.

    Attributes:
        mean: (axes, samples).
        log_std: (axes, samples) logarithm of the standard deviation.
    """

    mean: chex.Array
    log_std: chex.Array

    @classmethod
    def of(cls, outputs: chex.Array) -> "Gaussian":
        """Of a network's (2 axes, samples) outputs: the mean by tanh, the deviation by sigmoid.

        Both have a gradient everywhere; a clipped one could not come back from its bounds.

        Example:
            >>> Gaussian.of(jnp.zeros((6, 1))).mode()
            Array([[0., 0., 0.]], dtype=float32)
        """
        mean, deviation = jnp.split(outputs, 2)
        return cls(jnp.tanh(mean), jnp.log(LEAST_STD + nn.sigmoid(deviation)))

    @staticmethod
    def noise(key: chex.PRNGKey, shape: tuple[int, ...], dtype: jnp.dtype) -> chex.Array:
        """What :meth:`draw` needs: a normal number for each of three axes."""
        return jax.random.normal(key, (*shape, 3), dtype)

    def draw(self, noise: chex.Array, greedy: np.ndarray | bool = False) -> chex.Array:
        """Random actions; the mode where greedy."""
        noise = jnp.where(np.asarray(greedy)[..., None], 0.0, noise)
        return (self.mean + jnp.exp(self.log_std) * noise.T).T

    @classmethod
    def mode_of(cls, outputs: chex.Array) -> chex.Array:
        """The means, of a network's (2 axes, samples) outputs."""
        return cls.of(outputs).mode()

    def mode(self) -> chex.Array:
        """The means."""
        return self.mean.T

    def log_probability(self, action: chex.Array) -> chex.Array:
        """(samples,) of each sample's action."""
        deviation = (action.T - self.mean) * jnp.exp(-self.log_std)
        return -jnp.sum(deviation**2 / 2 + self.log_std + math.log(2 * math.pi) / 2, axis=0)

    def entropy(self) -> chex.Array:
        """(samples,) nats."""
        return jnp.sum(self.log_std + math.log(2 * math.pi * math.e) / 2, axis=0)


def _first_row(is_candidate):
    """(samples,) the first true row of each column; what argmax gives, but it vectorises."""
    rows = len(is_candidate)
    return jnp.min(jnp.where(is_candidate, jnp.arange(rows)[:, None], rows - 1), axis=0)
