"""The equations of motion in a world that is not perfect: late pulses, disturbances, wheels.

They have the methods of :class:`attjax.dynamics.equations.EquationsOfMotion`, so that the same
loop integrates them. What a world lacks is None here, and nothing of it is compiled.
"""

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from attjax.dynamics import vectors
from attjax.dynamics.bodies import BodyWithParts, RigidBody
from attjax.dynamics.disturbances import Acting, OwnDisturbance
from attjax.dynamics.equations import Kinematics
from attjax.dynamics.vectors import Vector
from attjax.spacecraft import INTEGRATION_STEP


class ForcedState(NamedTuple):
    """What changes with time; also its change, and its rate of change.

    Attributes:
        quaternion, angular_velocity: as of :class:`attjax.dynamics.equations.RigidState`.
        phasor: cosine and sine of a swinging torque's phase; None where none swings.
        seen: what sensors have sampled in the agent step: changes of quaternion and angular
            velocity from its start; None where they sample at its end.
        aboard: of what moves aboard, as the body has it; None where nothing does.
    """

    quaternion: tuple
    angular_velocity: Vector
    phasor: tuple[Any, Any] | None
    seen: tuple[Any, ...] = (None, None)
    aboard: tuple[Any, ...] | None = None


def unseen(samples: Sequence[Any]) -> tuple[Any, ...]:
    """Zeros for what sensors sample in an agent step: a quaternion's change, and a rate's.

    Args:
        samples: as of :class:`ForcedEquations`.
    """
    return tuple(None if x is None else (jnp.zeros_like(x),) * n for x, n in zip(samples, (4, 3)))


class Pulse(NamedTuple):
    """A commanded torque on its way, or there.

    Attributes:
        start: the RK4 step, counted from the beginning of this agent step, in which it begins.
        torque: body frame, or of reaction wheels along each one's axis, N m.
    """

    start: Any
    torque: tuple[Any, ...]


def torque_during(pulses: tuple[Pulse, ...], held: bool, number: Any) -> tuple[Any, ...]:
    """The torque in one RK4 step, N m, of as many components as the pulses'.

    Args:
        pulses: in the order in which they were commanded; if they are held, the first has begun.
        held: whether a pulse lasts until a later one begins, or for one RK4 step.
        number: of the RK4 step.

    Example:
        >>> late = Pulse(2.0, (1.0, 0.0, 0.0))
        >>> [float(torque_during((late,), False, n)[0]) for n in (1.0, 2.0, 3.0)]
        [0.0, 1.0, 0.0]
    """
    if held:
        first, *others = pulses
        return functools.reduce(
            lambda before, pulse: vectors.chosen(pulse.start <= number, pulse.torque, before),
            others,
            first.torque,
        )
    zeros = tuple(jnp.zeros_like(x) for x in pulses[0].torque)
    acting = [vectors.chosen(pulse.start == number, pulse.torque, zeros) for pulse in pulses]
    return functools.reduce(vectors.add, acting)


@jax.tree_util.register_static
@dataclasses.dataclass(frozen=True)
class Held:
    """Whether torques are held; known when it is compiled, and no number of a tree."""

    value: bool


class ForcedEquations(NamedTuple):
    """Eq. 6 with all torques, and Eq. 9.

    Attributes:
        pulses: commanded torques.
        held: whether these are held.
        body: that they turn.
        acting: what else acts during the agent step.
        swinging: a torque's amplitude, body frame, N m, and angular rate, rad/s.
        own: disturbances of a user's own.
        kinematics: of the attitude.
        samples: after how many RK4 steps star tracker and gyro sample; None: at the end.
        torque: in this RK4 step, of pulses, but of wheels', and of what acts, body frame, N m; None
            before :meth:`during`, or where there is none.
    """

    pulses: tuple[Pulse, ...]
    held: Held
    body: RigidBody | BodyWithParts
    acting: Acting
    swinging: tuple[Vector, Any] | None
    own: tuple[OwnDisturbance, ...]
    kinematics: Kinematics
    samples: tuple[Any, Any] = (None, None)
    torque: Vector | None = None

    @property
    def steps_together(self) -> int:
        """RK4 steps in one loop; of more the intermediate results would not fit the registers."""
        return 3

    @property
    def is_timed(self) -> bool:
        """They are told which RK4 step it is, as pulses and samples have theirs."""
        return True

    def during(self, number: Any, state: ForcedState) -> "ForcedEquations":
        """The equations of that RK4 step, counted from 0: its pulses' torque is on.

        What acts does so as at the attitude in the step's middle: of one that turns by φ
        meanwhile it is off by φ²/6, and to find it at each stage takes 1.7 times as long.
        """
        commanded = torque_during(self.pulses, self.held.value, number)
        body: Any = self.body  # of whose kind the state is
        torque, body = body.during(commanded, state.aboard)
        turn = self.kinematics.rate(state.quaternion, state.angular_velocity)
        middle = vectors.add(state.quaternion, tuple(INTEGRATION_STEP / 2 * x for x in turn))
        found = [x for x in (torque, self.acting.torque(middle)) if x is not None]
        return self._replace(
            torque=functools.reduce(vectors.add, found) if found else None, body=body
        )

    def after(self, number: Any, change: ForcedState) -> ForcedState:
        """The change from the agent step's start to that RK4 step's end, and what is seen then."""
        moved = change.quaternion, change.angular_velocity
        seen = [
            None if sample is None else vectors.chosen(number + 1 == sample, now, before)
            for sample, now, before in zip(self.samples, moved, change.seen)
        ]
        return change._replace(seen=tuple(seen))

    def coasting(self) -> "ForcedEquations":
        """The same: each pulse says itself when it is on."""
        return self

    def rate(self, state: ForcedState) -> ForcedState:
        """Rate of change of the state."""
        torques, phasor_rate = [self.torque], None
        torques += [x.torque(state.quaternion, state.angular_velocity) for x in self.own]
        if self.swinging is not None and state.phasor is not None:
            (cosine, sine), (amplitude, rate) = state.phasor, self.swinging
            torques.append(vectors.scaled(sine, amplitude))
            phasor_rate = -rate * sine, rate * cosine
        found = [x for x in torques if x is not None]
        body: Any = self.body
        acceleration, moving = body.rate(found, state.angular_velocity, state.aboard)
        rates = self.kinematics.rate(state.quaternion, state.angular_velocity)
        still = jax.tree.map(jnp.zeros_like, state.seen)
        return ForcedState(rates, acceleration, phasor_rate, still, moving)
