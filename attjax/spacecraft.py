"""A spacecraft and its task, as a user describes them; LM50, the paper's.

This module imports nothing heavy, so that errors in a description are instant.
"""

import codecs
import dataclasses
import math
import operator
import tomllib
from pathlib import Path

from attjax.values import check_moments, check_number, check_numbers, plain, shown

INTEGRATION_STEP = 1 / 240
"""Length of one RK4 step, s (paper, section 2.3)."""

NEEDED = ("inertia", "torque_levels")
"""What a file that describes another spacecraft than LM50 must give."""

LEAST_MOMENT, MOST_MOMENT, LEAST_RATIO = 1e-9, 1e9, 1e-3
ROUNDING = 1e-6
"""Less than what the simulator's own checks let pass, :data:`attjax.checks.ROUNDING`.

What a description may be thus passes there too, once its numbers are in single precision.
"""

MOST_TURNS = 2e5
"""Radians of an episode at the rate limit, times the ratio of the moments, of a full tensor.

Single precision knows a tensor's small moment to 1e-7 of the large one; over so many radians a
coasting body's energy drifts by half a hundredth (measured: at most 0.41/2^24 of it a radian).
"""

MOST_ACTIONS = 1000
MOST_DURATION = 1e6


@dataclasses.dataclass(frozen=True, kw_only=True)
class Spacecraft:
    """A spacecraft and the slews that it is to fly; by default LM50 and the paper's.

    Attributes:
        name: for people.
        inertia: three principal moments along the body axes, or three rows of a symmetric tensor
            in the body frame, kg m².
        torque_levels: magnitudes of torque about each axis, in both directions, N m.
        torque_axes: directions of these torques in the body frame; they are normalised.
        torque_held: whether a torque lasts the whole control period, as of reaction wheels, or
            1/240 s at its beginning, as in the paper.
        rate_limit: ‖ω‖ that ends an episode when exceeded, rad/s; no torque may pass it in 1/240 s.
        goal_angle_deg: largest error angle that counts as pointing, degrees.
        slew_angles_deg: least and largest initial error angle, degrees.
        duration: of an episode, s.

    Raises:
        ValueError: a value is not as said, or no rigid body has that inertia.

    Example:
        >>> Spacecraft(inertia=(0.05, 0.14, 0.17), torque_levels=(0.002,)).num_actions
        7
        >>> Spacecraft(inertia=(1, 1, 3))
        Traceback (most recent call last):
        ValueError: inertia has principal moments 1, 1, 3; none may exceed the other two together
    """

    name: str = "LM50"
    inertia: tuple = (0.872, 0.115, 0.797)
    torque_levels: tuple[float, ...] = (0.5, 0.05, 0.005)
    torque_axes: tuple[tuple[float, ...], ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    torque_held: bool = False
    rate_limit: float = 0.5
    goal_angle_deg: float = 0.25
    slew_angles_deg: tuple[float, ...] = (30, 150)
    duration: float = 43.75

    def __post_init__(self):
        for field in dataclasses.fields(self):
            object.__setattr__(self, field.name, plain(getattr(self, field.name)))
        if not isinstance(self.name, str) or not self.name.isprintable() or not self.name:
            raise ValueError(f"name is {self.name!r}; it must be a line of text")
        if not isinstance(self.torque_held, bool):
            raise ValueError(f"torque_held is {self.torque_held!r}; it must be true or false")
        least_moment, ratio = self._check_inertia()
        check_numbers("torque_levels", self.torque_levels, 1e-12, 1e6)
        self._check_axes()
        check_number("rate_limit", self.rate_limit, 1e-6, 100)
        kick = max(self.torque_levels) * INTEGRATION_STEP / least_moment
        if kick > self.rate_limit:
            raise ValueError(
                f"torque_levels has {max(self.torque_levels):g}, which changes the rate by up to "
                f"{kick:.3g} rad/s in 1/240 s; it must be at most rate_limit, {self.rate_limit:g}"
            )
        check_number("goal_angle_deg", self.goal_angle_deg, 1e-6, 180)
        check_numbers("slew_angles_deg", self.slew_angles_deg, 0, 180, count=2)
        if self.slew_angles_deg[0] > self.slew_angles_deg[1]:
            listed = shown(self.slew_angles_deg)
            raise ValueError(f"slew_angles_deg is {listed}; the first must be the least")
        check_number("duration", self.duration, INTEGRATION_STEP, MOST_DURATION)
        if ratio * self.rate_limit * self.duration > MOST_TURNS:
            raise ValueError(
                f"inertia is a tensor whose moments have the ratio {ratio:.4g}; single precision "
                f"follows it for at most {MOST_TURNS / ratio / self.rate_limit:.4g} s at a "
                f"rate_limit of {self.rate_limit:g}, and duration is {self.duration:g}: give it "
                f"in principal axes, as three moments, or shorten it"
            )

    def __str__(self):
        return self.name

    def _check_inertia(self):
        """Check it; returns the least moment, and the ratio of the largest to it if a tensor."""
        rows, is_tensor = self.inertia, False
        if isinstance(rows, tuple) and len(rows) == 3 and isinstance(rows[0], tuple):
            for row in rows:
                check_numbers("each row of inertia", row, count=3)
            moments, is_tensor = _principal_moments(rows), True
        else:
            check_numbers("inertia", rows, count=3)
            moments = sorted(rows)
        listed = ", ".join(f"{x:g}" for x in moments)
        if not LEAST_MOMENT <= moments[0] <= moments[2] <= MOST_MOMENT:
            raise ValueError(
                f"inertia has principal moments {listed}; "
                f"they must be from {LEAST_MOMENT:g} to {MOST_MOMENT:g}"
            )
        if moments[0] < LEAST_RATIO * moments[2]:
            raise ValueError(
                f"inertia has principal moments {listed}; the least must be at least "
                f"{LEAST_RATIO:g} of the largest"
            )
        check_moments(moments, ROUNDING)
        return moments[0], moments[2] / moments[0] if is_tensor else 1

    def _check_axes(self):
        axes = self.torque_axes
        if not isinstance(axes, tuple) or not axes:
            raise ValueError(f"torque_axes is {shown(axes)}; it must be a list of [x, y, z]")
        for axis in axes:
            check_numbers("each of torque_axes", axis, count=3)
            if not any(axis):
                raise ValueError(f"torque_axes holds {shown(axis)}; it must be a direction")
        if self.num_actions > MOST_ACTIONS:
            raise ValueError(
                f"torque_levels and torque_axes make {self.num_actions} actions; "
                f"they must be at most {MOST_ACTIONS}"
            )

    @classmethod
    def from_toml(cls, path: str | Path) -> "Spacecraft":
        """Read a TOML file of these names; it must give ``inertia`` and ``torque_levels``.

        Without a name, the spacecraft has the file's.

        Raises:
            OSError: it cannot be read.
            ValueError: it is no TOML, or something in it is not as said.
        """
        values = read_toml(path)
        return from_lists({"name": Path(path).stem} | values, NEEDED)

    @property
    def num_actions(self) -> int:
        """No torque, and each level about each axis in both directions."""
        return 1 + 2 * len(self.torque_levels) * len(self.torque_axes)

    @property
    def least_moment(self) -> float:
        """The least principal moment of inertia, kg m²."""
        is_tensor = isinstance(self.inertia[0], tuple)
        return min(_principal_moments(self.inertia) if is_tensor else self.inertia)

    @property
    def torque_table(self) -> list[list[float]]:
        """The torque of each action, N m, body frame, in the order of Table 1."""
        axes = [[x / math.hypot(*axis) for x in axis] for axis in self.torque_axes]
        signed = [
            [sign * level * x for x in axis]
            for level in self.torque_levels
            for axis in axes
            for sign in (1, -1)
        ]
        return [[0.0, 0.0, 0.0], *signed]

    @property
    def most_frameskip(self) -> int:
        """The largest frameskip: one agent step is then the whole episode."""
        return self.max_steps(0) - 1

    def max_steps(self, frameskip: int) -> int:
        """Whole agent steps in an episode, for that many RK4 steps after the first in each."""
        return int(self.duration / INTEGRATION_STEP + 1e-6) // (operator.index(frameskip) + 1)


def read_toml(path: str | Path) -> dict:
    """A TOML file's content; it may begin with a byte order mark, and then be in UTF-16, too.

    Editors and shells of Windows write such files.

    Raises:
        OSError: it cannot be read.
        ValueError: it is no TOML.
    """
    content = Path(path).read_bytes()
    is_utf_16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return tomllib.loads(content.decode("utf-16" if is_utf_16 else "utf-8-sig"))


def from_lists(values: dict, needed: tuple[str, ...] = ()) -> Spacecraft:
    """A spacecraft from what TOML or JSON make of its values.

    Raises:
        ValueError: a name is unknown or missing, or a value is not as :class:`Spacecraft` says.
    """
    if not isinstance(values, dict):
        raise ValueError(f"spacecraft is {values!r}; it must be a table")
    names = [field.name for field in dataclasses.fields(Spacecraft)]
    unknown = sorted(set(values) - set(names))
    if unknown:
        raise ValueError(f"{unknown[0]} is unknown; there are {', '.join(names)}")
    missing = [name for name in needed if name not in values]
    if missing:
        raise ValueError(f"{missing[0]} is missing; there must be {' and '.join(needed)}")
    return Spacecraft(**values)


def _principal_moments(rows):
    """The sorted eigenvalues of a symmetric tensor."""
    import numpy as np  # imported late: the usual inertia is three moments

    tensor = np.array(rows, float)
    if not np.allclose(tensor, tensor.T, rtol=0, atol=ROUNDING * np.max(np.abs(tensor))):
        raise ValueError(f"inertia is {shown(rows)}; it must be symmetric")
    return np.linalg.eigvalsh(tensor).tolist()


LM50 = Spacecraft()
"""The paper's."""
