"""What really flies in a world that is not perfect: drawn for an episode, and moved on.

A controller, and all that judges it, believes in :class:`attjax.EnvParams`; what moves is this.
"""

from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
from flax import struct

from attjax.dynamics import integration
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics.actuators import Actuators, Queue
from attjax.dynamics.bodies import body_of
from attjax.dynamics.disturbances import Disturbances, Orbit
from attjax.dynamics.draws import Draws
from attjax.dynamics.equations import Kinematics, add
from attjax.dynamics.forced_motion import ForcedEquations, ForcedState, Held, unseen
from attjax.dynamics.fused_loop import apart, together
from attjax.dynamics.integration import AgentStep
from attjax.dynamics.moving_parts import FlexibleMode, Wheels
from attjax.dynamics.noise import Noise
from attjax.dynamics.sensing import Seen, Sensing
from attjax.spacecraft import INTEGRATION_STEP


class Change(NamedTuple):
    """What becomes of the inertia at a moment.

    Attributes:
        factor: of it from then on.
        time: s after the start of the episode.
    """

    factor: chex.Array
    time: chex.Array


class Plant(struct.PyTreeNode):
    """One spacecraft in its world, in one episode.

    Attributes:
        key: of what is random in each step, as data of a JAX key.
        inertia: (3,) principal moments or (3, 3) tensor, kg m², with all that moves aboard.
        actuators: what becomes of commands; None: just what they say.
        queue: of pulses on their way.
        orbit: None in a world without one.
        disturbances: what else acts.
        own_disturbances, own_actuators, own_sensors: of a user's own.
        sensing: sensors and what they say; None: the truth is told.
        wheels, wheel_speeds: reaction wheels, and (axes,) their speeds against the body, rad/s.
        flexible, deflection: an appendage's mode, and (2,) its η and η̇.
        change: of the inertia; None: there is none.
    """

    key: chex.Array
    inertia: chex.Array
    actuators: Actuators | None
    queue: Queue
    orbit: Orbit | None
    disturbances: Disturbances
    own_disturbances: tuple[Any, ...] = ()
    own_actuators: tuple[Any, ...] = ()
    own_sensors: tuple[Any, ...] = ()
    sensing: Sensing | None = None
    wheels: Wheels | None = None
    wheel_speeds: chex.Array | None = None
    flexible: FlexibleMode | None = None
    deflection: chex.Array | None = None
    change: Change | None = None

    def inertia_at(self, time: chex.Numeric) -> chex.Array:
        """The inertia so many seconds after the start of the episode."""
        if self.change is None:
            return self.inertia
        return jnp.where(time >= self.change.time, self.change.factor, 1) * self.inertia

    def moved(
        self,
        agent_step: AgentStep,
        quaternion: chex.Array,
        angular_velocity: chex.Array,
        time: chex.Array,
        steps_after: chex.Numeric | None,
    ) -> tuple[chex.Array, chex.Array, "Plant"]:
        """Quaternion, angular velocity, rad/s, and the plant, an agent step later.

        Args:
            agent_step: what is known of it when it is compiled.
            quaternion, angular_velocity: before it, (4,) and (3,).
            time: agent steps since the start of the episode.
            steps_after: RK4 steps after the first; None: the agent step's frameskip.
        """
        dtype = angular_velocity.dtype
        limit = None if steps_after is None else jnp.asarray(steps_after, dtype)
        rk4_steps = 1 + (agent_step.frameskip if limit is None else limit)
        period = jnp.asarray(rk4_steps, dtype) * INTEGRATION_STEP
        times = time * rk4_steps, (time + 1) * rk4_steps
        samples = (None, None) if self.sensing is None else self.sensing.samples(times, dtype)
        phasor = self._phasor(time * period)
        body = tuple(quaternion), tuple(angular_velocity)
        start = ForcedState(*body, phasor, unseen(samples), self._aboard())
        equations = self._equations(agent_step, (time + 0.5) * period)._replace(samples=samples)
        change: Any = integration.change(agent_step, start, equations, limit)
        end = _attained(start, *change[:2])
        plant = self.replace(queue=self.queue.later(rk4_steps))
        if start.aboard is not None:
            moved = (x if x is None else jnp.stack(x) for x in add(start.aboard, change.aboard))
            plant = plant.replace(**dict(zip(("wheel_speeds", "deflection"), moved)))
        if self.sensing is not None:
            sampled = tuple(x or y for x, y in zip(change.seen, change[:2]))
            seen, there = (Seen(*add(start[:2], x)) for x in (sampled, change[:2]))
            sensing = self.sensing.after(seen, there, times, Noise.of(self.key, time))
            plant = plant.replace(sensing=sensing)
        return *end, plant

    def _draws(self, time):
        key = jax.random.fold_in(jax.random.wrap_key_data(self.key), time)
        return Draws(key, self.inertia.dtype)

    def _phasor(self, time):
        if self.disturbances.swinging is None:
            return None
        _, rate, start = self.disturbances.swinging
        return jnp.cos(start + rate * time), jnp.sin(start + rate * time)

    def _aboard(self):
        if self.wheels is None and self.flexible is None:
            return None
        return tuple(x if x is None else tuple(x) for x in (self.wheel_speeds, self.deflection))

    def _equations(self, agent_step, middle):
        body = body_of(self.inertia_at(middle), self.wheels, self.flexible)
        swinging = self.disturbances.swinging
        return ForcedEquations(
            pulses=self.queue.pulses(),
            held=Held(agent_step.held),
            body=body,
            acting=together(Disturbances.during, self.disturbances, self.orbit, middle),
            swinging=None if swinging is None else swinging[:2],
            own=self.own_disturbances,
            kinematics=Kinematics(agent_step.kinematic_factor),
        )

    def commanded(self, torque: chex.Array, time: chex.Array) -> "Plant":
        """The plant with one more pulse on its way.

        Args:
            torque: that the actuators make of the command, N m: (3,) body frame, or (axes,) of
                wheels.
            time: agent steps since the start of the episode.
        """
        delay: chex.Numeric = 0
        if self.actuators is not None:
            delay = self.actuators.delay_of(self._draws(time))
        return self.replace(queue=self.queue.and_then(delay, apart(torque)))


def _attained(start, turn, acceleration):
    """Attitude (4,) and rate (3,) after a change of the quaternion and of the rate."""
    quaternion = quaternions.normalize(jnp.stack(add(start.quaternion, turn)))
    return Seen(quaternion, jnp.stack(add(start.angular_velocity, acceleration)))
