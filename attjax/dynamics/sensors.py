"""A gyro and a star tracker: what they say of a rate and of an attitude."""

import chex
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax.dynamics import numerics
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics.clock import Clock


class Gyro(struct.PyTreeNode):
    """A gyro of one spacecraft in one episode; what is ideal is None.

    Attributes:
        matrix: (3, 3), of the rate: scale factors and misalignments.
        noise: standard deviation of a sample about each axis, rad/s.
        bias: (3,) rad/s.
        wandering: standard deviation of what the bias wanders, rad/s.
        wandered: (3,) of it now, rad/s.
        correlation_time: of the wandering, s.
        rate_limit: rad/s.
        resolution: rad/s.
        clock: of its samples.
    """

    matrix: chex.Array | None = None
    noise: chex.Array | None = None
    bias: chex.Array | None = None
    wandering: chex.Array | None = None
    wandered: chex.Array | None = None
    correlation_time: float = struct.field(pytree_node=False, default=1.0)
    rate_limit: float | None = struct.field(pytree_node=False, default=None)
    resolution: float = struct.field(pytree_node=False, default=0.0)
    clock: Clock = struct.field(pytree_node=False, default=Clock())

    def reading(self, angular_velocity: chex.Array, noise: chex.Array) -> chex.Array:
        """What it says of a rate (3,), rad/s, with standard normal noise (3,)."""
        rate = angular_velocity
        if self.matrix is not None:
            rate = jnp.sum(self.matrix * rate, axis=1)
        for error in (self.bias, self.wandered):
            rate = rate if error is None else rate + error
        if self.noise is not None:
            rate = rate + self.noise * noise
        if self.rate_limit is not None:
            rate = jnp.clip(rate, -self.rate_limit, self.rate_limit)
        if self.resolution:
            rate = jnp.round(rate / self.resolution) * self.resolution
        return rate

    def later(self, seconds: chex.Numeric, noise: chex.Array) -> "Gyro":
        """The same after some time, with standard normal noise (3,): its bias has wandered.

        Exactly as a Gauss-Markov process of first order does in that time.
        """
        if self.wandering is None or self.wandered is None:
            return self
        kept = jnp.exp(-seconds / self.correlation_time)
        fresh = self.wandering * jnp.sqrt(1 - kept**2) * noise
        return self.replace(wandered=kept * self.wandered + fresh)


class StarTracker(struct.PyTreeNode):
    """A star tracker of one spacecraft in one episode.

    Attributes:
        across, about: standard deviations across the boresight and about it, rad.
        boresight: (3,) unit vector, body frame; known when it is compiled.
        most_rate: rad/s, above which it says nothing.
        clock: of its samples.
    """

    across: chex.Array
    about: chex.Array
    boresight: tuple[float, ...] = struct.field(pytree_node=False, default=(0.0, 0.0, 1.0))
    most_rate: float | None = struct.field(pytree_node=False, default=None)
    clock: Clock = struct.field(pytree_node=False, default=Clock())

    def reading(self, quaternion: chex.Array, noise: chex.Array) -> chex.Array:
        """What it says of an attitude (4,), with standard normal noise (3,)."""
        axis = np.array(self.boresight) / np.linalg.norm(self.boresight)
        axis = jnp.asarray(axis, quaternion.dtype)
        along = jnp.sum(noise * axis)
        error = self.across * noise + (self.about - self.across) * along * axis
        return quaternions.turned(quaternion, error)

    def can_see(self, angular_velocity: chex.Array) -> chex.Array:
        """Whether it says anything at a rate (3,), rad/s."""
        if self.most_rate is None:
            return jnp.asarray(True)
        return numerics.squared_norm(angular_velocity) <= self.most_rate**2
