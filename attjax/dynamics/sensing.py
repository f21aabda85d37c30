"""What the sensors have said of a state: each samples at its own times, and is heard at decisions.

A sensor samples at multiples of its period since the episode's start, and what it has sampled is
told at the first decision after its latency.
"""

from typing import Any, NamedTuple, Protocol

import chex
import jax.numpy as jnp
from flax import struct

from attjax.dynamics.clock import Clock
from attjax.dynamics.fused_loop import together
from attjax.dynamics.noise import Noise
from attjax.dynamics.sensors import Gyro, StarTracker
from attjax.dynamics.vectors import chosen, components, unit
from attjax.spacecraft import INTEGRATION_STEP


class Measurement(struct.PyTreeNode):
    """What the sensors say at a decision: the newest of each, and whether it is new.

    Attributes:
        quaternion: (4,) attitude towards the target's frame, scalar last.
        has_quaternion: whether it has been told since the last decision.
        angular_velocity: (3,) body frame, rad/s.
        has_angular_velocity: the same of it.
        wheel_speeds: (axes,) of reaction wheels against the body, rad/s; None: it has none.
    """

    quaternion: chex.Array
    has_quaternion: chex.Array
    angular_velocity: chex.Array
    has_angular_velocity: chex.Array
    wheel_speeds: chex.Array | None = None


class OwnSensor(Protocol):
    """A sensor of a user's own: a tree of numbers with this method."""

    def told(self, measurement: Measurement, state: Any, key: chex.PRNGKey) -> Measurement:
        """What is told at a decision.

        Args:
            measurement: that the world's sensors tell.
            state: the true :class:`attjax.EnvState`.
            key: of this decision.
        """


class Seen(NamedTuple):
    """What the sensors sample: attitude (4,) and rate (3,), rad/s; also by components."""

    quaternion: Any
    angular_velocity: Any


class Sensing(struct.PyTreeNode):
    """The sensors of one spacecraft, and what they have said.

    Attributes:
        gyro, star_tracker: None: the truth is told at each decision.
        waiting: (4,) attitude that was sampled last and may not yet be told.
        told: at the last decision.
    """

    gyro: Gyro | None
    star_tracker: StarTracker | None
    waiting: chex.Array
    told: Measurement

    @property
    def clocks(self) -> tuple[Clock, Clock]:
        """Of star tracker and gyro."""
        sensors = self.star_tracker, self.gyro
        tracker, gyro = (Clock() if x is None else x.clock for x in sensors)
        return tracker, gyro

    def samples(
        self, times: tuple[chex.Array, chex.Array], dtype: chex.ArrayDType
    ) -> tuple[chex.Array | None, chex.Array | None]:
        """After how many RK4 steps of an agent step each samples; None: at its end.

        Args:
            times: of its start and its end, RK4 steps since the episode's start.
            dtype: of the result.
        """
        tracker, gyro = (
            jnp.asarray(clock.to_be_seen(*times), dtype) if clock.period else None
            for clock in self.clocks
        )
        return tracker, gyro

    def after(
        self, seen: Seen, end: Seen, times: tuple[chex.Array, chex.Array], noise: Noise
    ) -> "Sensing":
        """The sensors at the end of an agent step.

        Args:
            seen: what was sampled in it, by components; a quaternion of any length, which is
                made 1 here, for a loop that looks for another's arrays is not vectorised.
            end: the state at its end, likewise.
            times: of its start and its end, RK4 steps since the episode's start.
            noise: of the agent step.
        """
        wandered, waiting, told = together(_later, components(self), seen, end, times, noise)
        gyro = self.gyro
        if gyro is not None and wandered is not None:
            gyro = gyro.replace(wandered=jnp.stack(wandered))
        return self.replace(gyro=gyro, waiting=jnp.stack(waiting), told=_stacked(told))

    @classmethod
    def begun(
        cls, sensors: tuple[StarTracker | None, Gyro | None], state: Seen, noise: Noise
    ) -> "Sensing":
        """The sensors at an episode's start, which each of them tells at once.

        Args:
            sensors: star tracker and gyro.
            state: attitude (4,) and rate (3,) at the start.
            noise: of the start.
        """
        tracker, gyro = components(sensors)
        always = jnp.asarray(True)
        attitude, rate = components(state)
        if tracker is not None:
            attitude = tracker.reading(attitude, noise)
        if gyro is not None:
            rate = gyro.reading(rate, noise)
        told = _stacked(Measurement(attitude, always, rate, always))
        return cls(sensors[1], sensors[0], waiting=state.quaternion, told=told)


def _stacked(told):
    return told.replace(
        quaternion=jnp.stack(told.quaternion), angular_velocity=jnp.stack(told.angular_velocity)
    )


def _later(sensing, seen, end, times, noise):
    """What of the sensors is another after an agent step: a wandering bias, waiting, told."""
    tracker, gyro = sensing.clocks
    start, now = times
    told_attitude, has_attitude = _told(tracker, start, now)
    _, has_rate = _told(gyro, start, now)
    seen_attitude = unit(seen.quaternion)
    attitude = chosen(told_attitude > start, seen_attitude, sensing.waiting)
    waiting = chosen(tracker.newest_taken(now) > start, seen_attitude, sensing.waiting)
    rate, wandered = seen.angular_velocity, None
    if sensing.gyro is not None:
        seconds = (now - start) * jnp.asarray(INTEGRATION_STEP, rate[0].dtype)
        its_gyro = sensing.gyro.later(seconds, noise)
        rate, wandered = its_gyro.reading(rate, noise), its_gyro.wandered
    if sensing.star_tracker is not None:
        attitude = sensing.star_tracker.reading(attitude, noise)
        has_attitude &= sensing.star_tracker.can_see(end.angular_velocity)
    told = Measurement(
        quaternion=chosen(has_attitude, attitude, sensing.told.quaternion),
        has_quaternion=has_attitude,
        angular_velocity=chosen(has_rate, rate, sensing.told.angular_velocity),
        has_angular_velocity=has_rate,
    )
    return wandered, waiting, told


def _told(clock, start, now):
    """When the newest sample was taken that is told by now, and whether it was not before."""
    newest = clock.newest_told(start, now)
    return newest, (newest >= 0) & (newest > clock.newest_told(2 * start - now, start))
