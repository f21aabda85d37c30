"""What the sensors have said of a state: each samples at its own times, and is heard at decisions.

A sensor samples at multiples of its period since the episode's start, and what it has sampled is
told at the first decision after its latency.
"""

from typing import NamedTuple

import chex
import jax.numpy as jnp
from flax import struct

from attjax.dynamics.clock import Clock
from attjax.dynamics.draws import Draws
from attjax.dynamics.sensors import Gyro, StarTracker
from attjax.spacecraft import INTEGRATION_STEP


class Measurement(struct.PyTreeNode):
    """What the sensors say at a decision: the newest of each, and whether it is new.

    Attributes:
        quaternion: (4,) attitude towards the target's frame, scalar last.
        has_quaternion: whether it has been told since the last decision.
        angular_velocity: (3,) body frame, rad/s.
        has_angular_velocity: the same of it.
    """

    quaternion: chex.Array
    has_quaternion: chex.Array
    angular_velocity: chex.Array
    has_angular_velocity: chex.Array


class Seen(NamedTuple):
    """What the sensors of an agent step have sampled: attitude (4,) and rate (3,)."""

    quaternion: chex.Array
    angular_velocity: chex.Array


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
        self, seen: Seen, end: Seen, times: tuple[chex.Array, chex.Array], draws: Draws
    ) -> "Sensing":
        """The sensors at the end of an agent step.

        Args:
            seen: what was sampled in it.
            end: the state at its end.
            times: of its start and its end, RK4 steps since the episode's start.
            draws: of the agent step.
        """
        noise = draws.normal("sensors", (9,))
        tracker, gyro = self.clocks
        start, now = times
        told_attitude, has_attitude = _told(tracker, start, now)
        _, has_rate = _told(gyro, start, now)
        attitude = jnp.where(told_attitude > start, seen.quaternion, self.waiting)
        is_fresh = tracker.newest_taken(now) > start
        waiting = jnp.where(is_fresh, seen.quaternion, self.waiting)
        its_gyro = self.gyro
        rate = seen.angular_velocity
        if its_gyro is not None:
            seconds = (now - start) * jnp.asarray(INTEGRATION_STEP, rate.dtype)
            its_gyro = its_gyro.later(seconds, noise[3:6])
            rate = its_gyro.reading(rate, noise[:3])
        if self.star_tracker is not None:
            attitude = self.star_tracker.reading(attitude, noise[6:])
            has_attitude &= self.star_tracker.can_see(end.angular_velocity)
        told = Measurement(
            quaternion=jnp.where(has_attitude, attitude, self.told.quaternion),
            has_quaternion=has_attitude,
            angular_velocity=jnp.where(has_rate, rate, self.told.angular_velocity),
            has_angular_velocity=has_rate,
        )
        return self.replace(gyro=its_gyro, waiting=waiting, told=told)

    @classmethod
    def begun(
        cls, sensors: tuple[StarTracker | None, Gyro | None], state: Seen, draws: Draws
    ) -> "Sensing":
        """The sensors at an episode's start, which each of them tells at once.

        Args:
            sensors: star tracker and gyro.
            state: attitude and rate at the start.
            draws: of the start.
        """
        tracker, gyro = sensors
        noise, always = draws.normal("sensors", (6,)), jnp.asarray(True)
        attitude, rate = state
        if tracker is not None:
            attitude = tracker.reading(attitude, noise[3:])
        if gyro is not None:
            rate = gyro.reading(rate, noise[:3])
        told = Measurement(attitude, always, rate, always)
        return cls(gyro=gyro, star_tracker=tracker, waiting=state.quaternion, told=told)


def _told(clock, start, now):
    """When the newest sample was taken that is told by now, and whether it was not before."""
    newest = clock.newest_told(start, now)
    return newest, (newest >= 0) & (newest > clock.newest_told(2 * start - now, start))
