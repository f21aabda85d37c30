"""What a world's description leaves open, drawn for one episode."""

import dataclasses
import math
import zlib

import chex
import jax
import jax.numpy as jnp

from attjax.dynamics import numerics
from attjax.world.distributions import LogUniform, Normal, Number, Uniform


@dataclasses.dataclass(frozen=True)
class Draws:
    """Random numbers of an episode, each by its name: none changes with what else is drawn.

    Attributes:
        key: of the episode's world.
        dtype: of the numbers.
    """

    key: chex.PRNGKey
    dtype: chex.ArrayDType

    def _key(self, name):
        return jax.random.fold_in(self.key, zlib.crc32(name.encode()))

    def number(self, name: str, number: Number, shape: tuple[int, ...] = ()) -> chex.Array:
        """A number of a description, or several drawn from it."""
        key, dtype = self._key(name), self.dtype
        if isinstance(number, Normal):
            low, high = ((x - number.mean) / number.deviation for x in number.support)
            standard = jax.random.truncated_normal(key, low, high, shape, dtype)
            return number.mean + number.deviation * standard
        if isinstance(number, LogUniform):
            low, high = jnp.log(jnp.array(number.support, dtype))
            return jnp.exp(jax.random.uniform(key, shape, dtype, low, high))
        if isinstance(number, Uniform):
            return jax.random.uniform(key, shape, dtype, *number.support)
        return jnp.full(shape, number, dtype)

    def direction(self, name: str) -> chex.Array:
        """A unit vector (3,), uniformly distributed."""
        return self._unit(name, 3)

    def attitude(self, name: str) -> chex.Array:
        """A unit quaternion (4,), uniformly distributed."""
        return self._unit(name, 4)

    def _unit(self, name, size):
        return numerics.unit(jax.random.normal(self._key(name), (size,), self.dtype))

    def tilted(self, name: str, direction: chex.Array, angle: chex.Array) -> chex.Array:
        """A unit vector (3,) at that angle, rad, to another, to any side alike."""
        anywhere = self.direction(name)
        across = numerics.unit(anywhere - jnp.sum(anywhere * direction) * direction)
        return jnp.cos(angle) * direction + jnp.sin(angle) * across

    def angle(self, name: str) -> chex.Array:
        """An angle, rad, any alike."""
        return jax.random.uniform(self._key(name), (), self.dtype, 0, 2 * math.pi)

    def normal(self, name: str, shape: tuple[int, ...] = ()) -> chex.Array:
        """Standard normal numbers."""
        return jax.random.normal(self._key(name), shape, self.dtype)
