"""A gyro and a star tracker: what they say of a rate and of an attitude.

They hold arrays; their methods are of the same by components, for a loop over a batch.
"""

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax.dynamics import quaternion as quaternions
from attjax.dynamics import vectors
from attjax.dynamics.clock import Clock
from attjax.dynamics.noise import Noise
from attjax.dynamics.vectors import Vector


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

    def reading(self, angular_velocity: Vector, noise: Noise) -> Vector:
        """What it says of a rate, rad/s, at a decision."""
        rate = angular_velocity
        if self.matrix is not None:
            rate = vectors.times(self.matrix, rate)
        for error in (self.bias, self.wandered):
            rate = rate if error is None else vectors.add(rate, error)
        if self.noise is not None:
            white = noise.normal("gyro", 3, rate[0].dtype)
            rate = vectors.add(rate, vectors.scaled(self.noise, white))
        if self.rate_limit is not None:
            limit = self.rate_limit
            rate = jax.tree.map(lambda x: jnp.clip(x, -limit, limit), rate)
        if self.resolution:
            step = self.resolution
            rate = jax.tree.map(lambda x: jnp.round(x / step) * step, rate)
        return rate

    def later(self, seconds: chex.Numeric, noise: Noise) -> "Gyro":
        """The same after some time, at a decision: its bias has wandered.

        Exactly as a Gauss-Markov process of first order does in that time.
        """
        if self.wandering is None or self.wandered is None:
            return self
        kept = jnp.exp(-seconds / self.correlation_time)
        size = self.wandering * jnp.sqrt(1 - kept**2)
        fresh = noise.normal("gyro.wandered", 3, size.dtype)
        return self.replace(wandered=vectors.combined(kept, self.wandered, size, fresh))


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

    def reading(self, quaternion: tuple, noise: Noise) -> tuple:
        """What it says of an attitude, four components, at a decision."""
        x, y, z = (np.array(self.boresight) / np.linalg.norm(self.boresight)).tolist()
        each = noise.normal("star_tracker", 3, quaternion[0].dtype)
        along = (self.about - self.across) * vectors.dot((x, y, z), each)
        return quaternions.turned(quaternion, vectors.combined(self.across, each, along, (x, y, z)))

    def can_see(self, angular_velocity: Vector) -> chex.Numeric:
        """Whether it says anything at a rate, rad/s."""
        if self.most_rate is None:
            return True
        return vectors.dot(angular_velocity, angular_velocity) <= self.most_rate**2
