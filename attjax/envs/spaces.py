"""Observation and action spaces, with the attributes that gymnax's have."""

import dataclasses
from typing import Any, ClassVar

import chex
import jax
import jax.numpy as jnp

from attjax.dynamics import rigid_body
from attjax.envs.context import Context
from attjax.envs.parameters import EnvParams
from attjax.envs.torques import largest_torques


@dataclasses.dataclass(frozen=True)
class Discrete:
    """The integers 0 to n − 1."""

    n: int
    shape: ClassVar[tuple[int, ...]] = ()
    dtype: ClassVar[Any] = jnp.int32

    def sample(self, key: chex.PRNGKey) -> chex.Array:
        """A uniformly random element, int32."""
        return jax.random.randint(key, self.shape, 0, self.n, self.dtype)

    def contains(self, x: Any) -> chex.Array:
        """Whether x is an integer of the space."""
        x = jnp.asarray(x)
        integral = jnp.issubdtype(x.dtype, jnp.integer) and x.shape == self.shape
        return integral & (x >= 0) & (x < self.n)


@dataclasses.dataclass(frozen=True, eq=False)
class Box:
    """Real vectors between the arrays ``low`` and ``high``, bounds included."""

    low: chex.Array
    high: chex.Array

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of an element."""
        return self.low.shape

    @property
    def dtype(self) -> jnp.dtype:
        """Type of an element's entries."""
        return self.low.dtype

    def sample(self, key: chex.PRNGKey) -> chex.Array:
        """A uniformly random element."""
        return jax.random.uniform(key, self.shape, self.dtype, self.low, self.high)

    def contains(self, x: Any) -> chex.Array:
        """Whether x has the space's shape and lies within its bounds."""
        x = jnp.asarray(x)
        if x.shape != self.shape:
            return jnp.array(False)
        return jnp.all((x >= self.low) & (x <= self.high))


def observation_box(params: EnvParams, context: Context) -> Box:
    """Of :meth:`attjax.AttitudeEnv.observation_space`."""
    moments = rigid_body.principal_moments(params.inertia)
    torque = context.largest_torque
    if context.continuous:
        torque = jnp.linalg.norm(largest_torques(context.torque_table))
    kick = torque * context.torque_duration / jnp.min(moments)
    rate = (params.rate_limit + kick) * jnp.sqrt(jnp.max(moments) / jnp.min(moments))
    one = jnp.ones_like(rate)
    high = jnp.stack([one] * 4 + [context.kinematic_factor * rate] * 4 + [rate] * 3)
    return Box(-high, high)
