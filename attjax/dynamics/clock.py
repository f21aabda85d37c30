"""When a sensor samples and when that is told, counted in RK4 steps since the episode's start."""

from typing import NamedTuple

import chex
import jax.numpy as jnp


class Clock(NamedTuple):
    """When a sensor samples, RK4 steps; known when it is compiled.

    Attributes:
        period: between two samples; 0: it samples at each decision.
        latency: from a sample to when it is told; at most the period.
    """

    period: int = 0
    latency: int = 0

    def newest_taken(self, now: chex.Numeric) -> chex.Numeric:
        """When the newest sample was taken, told or not."""
        return now if self.period == 0 else now // self.period * self.period

    def newest_told(self, start: chex.Numeric, end: chex.Numeric) -> chex.Numeric:
        """When the newest sample was taken that is told by the end of an agent step.

        Of those taken in one agent step the last is kept; negative: none is told at its end that
        was not told before.

        Args:
            start, end: of the agent step.
        """
        newest, before = self.newest_taken(end), self.newest_taken(start)
        of_before = jnp.where(before + self.latency <= end, before, -1)
        return jnp.where(newest + self.latency <= end, newest, of_before)

    def to_be_seen(self, start: chex.Numeric, end: chex.Numeric) -> chex.Numeric:
        """After how many RK4 steps of an agent step its last sample is taken; −1: there is none.

        Args:
            start, end: of the agent step.

        Example:
            >>> clock = Clock(period=60, latency=10)
            >>> [int(clock.to_be_seen(start, start + 21)) for start in (21, 42, 63)]
            [-1, 18, -1]
        """
        newest = self.newest_taken(end)
        return jnp.where(newest > start, newest - start, -1)
