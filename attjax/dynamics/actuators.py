"""From a command to the pulse that comes of it: gains, faults, granularity and delay."""

from typing import Protocol

import chex
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax.dynamics.draws import Draws
from attjax.dynamics.forced_motion import Pulse
from attjax.dynamics.moving_parts import Motors
from attjax.world.distributions import Number


@struct.dataclass
class Commands:
    """Amounts of torque along the torque axes that an action asks for.

    Attributes:
        amounts: (axes,) N m, signed.
        level: of a discrete action, counted from 0 as the spacecraft's levels are; else −1.
        duration: of the torque, s.
        largest: (axes,) the largest amount along each axis, N m.
    """

    amounts: chex.Array
    level: chex.Array
    duration: chex.Array
    largest: chex.Array


class Actuators(struct.PyTreeNode):
    """The actuators of one spacecraft in one episode; what is ideal is None.

    Attributes:
        directions: (axes, 3) of the torque along each axis, body frame, gains included.
        faults: (axes,) factors from ``fault_time`` on.
        fault_time: s since the start of the episode.
        delay: RK4 steps.
        jitter: more of it, drawn for each command; a number of the world's description.
        dead_levels: that give nothing from ``fault_time`` on, counted from 0.
        minimum_impulse: N m s.
        granularity: of the time that the largest torque is on, s.
        motors: of reaction wheels; None: the torque comes from outside.
    """

    directions: chex.Array
    faults: chex.Array | None = None
    fault_time: chex.Array | None = None
    delay: chex.Array | None = None
    jitter: Number = struct.field(pytree_node=False, default=0.0)
    dead_levels: tuple[int, ...] = struct.field(pytree_node=False, default=())
    minimum_impulse: float = struct.field(pytree_node=False, default=0.0)
    granularity: float = struct.field(pytree_node=False, default=0.0)
    motors: Motors | None = None

    def torque(self, commands: Commands, time: chex.Numeric) -> chex.Array:
        """The torque that comes of a command, N m: (3,) body frame, or (axes,) of wheels.

        Args:
            commands: what was asked for.
            time: since the start of the episode, s.
        """
        amounts, duration = commands.amounts, commands.duration
        if self.dead_levels:
            is_dead = jnp.isin(commands.level, np.array(self.dead_levels))
            amounts = jnp.where(is_dead & (time >= self.fault_time), 0, amounts)
        if self.granularity:
            largest = jnp.where(commands.largest > 0, commands.largest, 1)
            on_time = duration * amounts / largest
            amounts = largest * jnp.round(on_time / self.granularity) * self.granularity / duration
        if self.minimum_impulse:
            is_enough = jnp.abs(amounts) * duration >= self.minimum_impulse
            amounts = jnp.where(is_enough, amounts, 0)
        if self.faults is not None:
            amounts = jnp.where(time >= self.fault_time, self.faults * amounts, amounts)
        if self.motors is not None:
            return self.motors.torques(amounts)
        return jnp.sum(amounts[:, None] * self.directions, axis=0)

    def delay_of(self, draws: Draws) -> chex.Numeric:
        """RK4 steps between a command and its pulse.

        Args:
            draws: of the command.
        """
        fixed = 0 if self.delay is None else self.delay
        if self.jitter == 0:
            return fixed
        return fixed + jnp.round(draws.number("delay_jitter", self.jitter))


class OwnActuator(Protocol):
    """An actuator of a user's own: a tree of numbers with this method."""

    def torque(self, torque: chex.Array, time: chex.Numeric) -> chex.Array:
        """What becomes of a torque (3,), body frame, N m; of wheels, of (axes,) along them.

        Args:
            torque: that the world's actuators would give.
            time: since the start of the episode, s.
        """


class Queue(struct.PyTreeNode):
    """Pulses on their way, in the order of their commands.

    Attributes:
        starts: (pulses,) RK4 step in which each begins, counted from the next decision.
        torques: (pulses, 3) body frame, or (pulses, axes) of wheels, N m.
    """

    starts: chex.Array
    torques: chex.Array

    def and_then(self, start: chex.Numeric, torque: chex.Array) -> "Queue":
        """The queue with a new command at its end, its oldest left out."""
        return Queue(
            jnp.append(self.starts[1:], start), jnp.concatenate([self.torques[1:], torque[None]])
        )

    def later(self, steps: chex.Numeric) -> "Queue":
        """The same, seen from a decision so many RK4 steps later."""
        return self.replace(starts=self.starts - steps)

    def pulses(self) -> tuple[Pulse, ...]:
        """One by one, by components."""
        count = len(self.starts)
        return tuple(Pulse(self.starts[n], tuple(self.torques[n])) for n in range(count))


LONG_AGO = -1e6
"""RK4 steps: when what stands in a queue at an episode's start began."""


def empty_queue(
    most_delay: int, rk4_steps: int, held: bool, dtype: chex.ArrayDType, size: int = 3
) -> Queue:
    """A queue long enough for commands that come up to ``most_delay`` RK4 steps late.

    Args:
        most_delay: RK4 steps.
        rk4_steps: the least of an agent step.
        held: whether a torque lasts until the next, which must then still be known.
        dtype: of its numbers.
        size: components of a torque.

    Example:
        >>> [len(empty_queue(n, 6, False, float).starts) for n in (0, 5, 6)]
        [1, 1, 2]
    """
    count = most_delay // rk4_steps + (2 if held else 1)
    return Queue(jnp.full(count, LONG_AGO, dtype), jnp.zeros((count, size), dtype))
