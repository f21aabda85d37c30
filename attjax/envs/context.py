"""What a controller knows of the spacecraft it steers, beside the observation."""

import chex
import jax.numpy as jnp
from flax import struct

from attjax.dynamics.integration import AgentStep
from attjax.envs.knowledge import Knowledge, knowledge
from attjax.envs.parameters import EnvParams, control_period
from attjax.spacecraft import INTEGRATION_STEP
from attjax.world import World


@struct.dataclass
class Context:
    """Constants of a closed loop, given to every policy and controller.

    Attributes:
        control_period: time between two actions, s.
        inertia: (3,) principal moments or (3, 3) tensor, body frame, kg m².
        torque_table: (actions, 3) torque of each action, body frame, N m.
        rate_limit: largest admissible ‖ω‖, rad/s.
        torque_duration: how long a torque acts, from the beginning of a control period, s.
        knowledge: of the world; by default the truth is told, and torques come at once.
        steps_after: RK4 steps after the first in a control period, where those of one program
            differ; None: those of ``agent_step``.
        disturbance: (3,) torque that always acts, body frame, N m; None: none is known.
        agent_step: what is known of a control period when it is compiled.
        observes_quaternion_rate: whether Eq. 11's q̇ is observed; a Python bool.
        continuous: whether an action is (3,) fractions of the largest torque about each body axis
            instead of a row of the table; a Python bool.
        torque_axes: how many there are that the table's torques are along, in Table 1's order.
    """

    control_period: chex.Array
    inertia: chex.Array
    torque_table: chex.Array
    rate_limit: chex.Array
    torque_duration: chex.Numeric = INTEGRATION_STEP
    knowledge: Knowledge = Knowledge()
    steps_after: chex.Array | None = None
    disturbance: chex.Array | None = None
    agent_step: AgentStep = struct.field(pytree_node=False, default=AgentStep(0))
    observes_quaternion_rate: bool = struct.field(pytree_node=False, default=True)
    continuous: bool = struct.field(pytree_node=False, default=False)
    torque_axes: int = struct.field(pytree_node=False, default=3)

    @property
    def kinematic_factor(self) -> float:
        """Of the kinematics: ½ by Eq. 9."""
        return self.agent_step.kinematic_factor

    @property
    def largest_torque(self) -> chex.Array:
        """The largest magnitude in the torque table, N m."""
        return jnp.sqrt(jnp.max(jnp.sum(self.torque_table**2, axis=-1)))

    def integral_of_rate(self, angle: chex.Numeric) -> chex.Numeric:
        """∫ω dt, rad, of a turn by ``angle`` about a fixed axis: by Eq. 9 the angle itself."""
        factor = self.kinematic_factor
        return angle if factor == 0.5 else angle / (2 * factor)


def believed(
    params: EnvParams,
    world: World,
    agent_step: AgentStep,
    axes: chex.Array | None,
    told: tuple[bool, bool, int],
) -> Context:
    """The context of a spacecraft in a world.

    Args:
        params: of the spacecraft, as believed.
        world: that it flies in.
        agent_step: as of :class:`Context`.
        axes: (axes, 3) unit vectors of the torque axes, body frame, where they have wheels.
        told: ``observes_quaternion_rate``, ``continuous`` and ``torque_axes``, as of
            :class:`Context`.
    """
    period = control_period(params, agent_step.frameskip)
    return Context(
        control_period=period,
        inertia=params.inertia,
        torque_table=params.torque_table,
        rate_limit=params.rate_limit,
        torque_duration=period if params.torque_held else INTEGRATION_STEP,
        knowledge=knowledge(world, params.inertia, period, axes),
        steps_after=params.frameskip,
        disturbance=params.disturbance,
        agent_step=agent_step,
        observes_quaternion_rate=told[0],
        continuous=told[1],
        torque_axes=told[2],
    )
