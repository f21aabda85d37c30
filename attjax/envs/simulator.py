"""One spacecraft: its state, its parameters (Table 1, section 2.3) and the agent step."""

import operator

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax import checks
from attjax.dynamics import propagation
from attjax.dynamics.integration import AgentStep
from attjax.spacecraft import LM50, Spacecraft
from attjax.values import check_share, check_truth


class EnvState(struct.PyTreeNode):
    """State of one spacecraft.

    Attributes:
        quaternion: (4,) error quaternion, scalar last.
        angular_velocity: (3,) body frame, rad/s.
        time: agent steps since the start of the episode, int32.
    """

    quaternion: chex.Array
    angular_velocity: chex.Array
    time: chex.Array


class EnvParams(struct.PyTreeNode):
    """Parameters of the spacecraft and its task; all numbers can be traced and vmapped.

    Attributes:
        inertia: (3,) principal moments or (3, 3) symmetric tensor, kg m².
        torque_table: (actions, 3) torque of each action, N m.
        rate_limit: ‖ω‖ that ends the episode when exceeded, rad/s.
        goal_angle: largest φ that counts as pointing, rad.
        min_slew_angle, max_slew_angle: range of the initial φ, rad.
        max_steps_in_episode: time limit, agent steps, int32.
        frameskip: RK4 steps after the first in an agent step, int32, where spacecraft of one batch
            differ; at most the environment's. None: the environment's.
        torque_held: whether a torque lasts through the agent step, or only its first RK4 step; a
            Python bool, the same for all of a batch.
    """

    inertia: chex.Array
    torque_table: chex.Array
    rate_limit: chex.Array
    goal_angle: chex.Array
    min_slew_angle: chex.Array
    max_slew_angle: chex.Array
    max_steps_in_episode: chex.Array
    frameskip: chex.Array | None = None
    torque_held: bool = struct.field(pytree_node=False, default=False)


def default_params(frameskip: int = 20, spacecraft: Spacecraft = LM50) -> EnvParams:
    """A spacecraft and its task, by default the paper's, in JAX's default floating-point type."""
    low, high = np.deg2rad(spacecraft.slew_angles_deg)
    return EnvParams(
        inertia=jnp.array(spacecraft.inertia, float),
        torque_table=jnp.array(spacecraft.torque_table, float),
        rate_limit=jnp.array(spacecraft.rate_limit, float),
        goal_angle=jnp.array(np.deg2rad(spacecraft.goal_angle_deg), float),
        min_slew_angle=jnp.array(low, float),
        max_slew_angle=jnp.array(high, float),
        max_steps_in_episode=jnp.array(spacecraft.max_steps(frameskip), jnp.int32),
        torque_held=spacecraft.torque_held,
    )


def check_params(params: EnvParams, frameskip: int) -> None:
    """Check parameters of one spacecraft, as far as they have values.

    Raises:
        ValueError: one is not what :class:`EnvParams` says.
    """
    checks.inertia(params.inertia)
    checks.real("torque_table", params.torque_table, (None, 3))
    checks.real("rate_limit", params.rate_limit, (), above=0)
    checks.real("goal_angle", params.goal_angle, (), above=0)
    low = checks.real("min_slew_angle", params.min_slew_angle, (), low=0)
    low = np.asarray(low) if checks.has_value(low) else None
    checks.real("max_slew_angle", params.max_slew_angle, (), low=low)
    checks.integer("max_steps_in_episode", params.max_steps_in_episode, 1, 2**31 - 1)
    if params.frameskip is not None:
        checks.integer("params.frameskip", params.frameskip, 0, frameskip)
    check_truth("params.torque_held", params.torque_held)


def applied_torque(action: chex.Numeric, params: EnvParams) -> chex.Array:
    """The torque that an action gives: the one way from a decision to what turns the spacecraft.

    Args:
        action: integer scalar, row of the torque table (Table 1); or (3,) real, fractions of
            :func:`largest_torques`, clipped to [−1, 1].
        params: of the spacecraft.

    Returns:
        (3,) torque, body frame, N m, for as long as the environment's context says.

    Raises:
        ValueError: the action is real, and the table as :func:`largest_torques` says.

    Example:
        >>> applied_torque(3, default_params()).tolist()
        [0.0, 0.5, 0.0]
        >>> applied_torque(jnp.array([0.5, -1.0, 2.0]), default_params()).tolist()
        [0.25, -0.5, 0.5]
    """
    if np.ndim(action) == 0:
        return params.torque_table[action]
    largest = largest_torques(params.torque_table)
    return jnp.clip(jnp.asarray(action, largest.dtype), -1, 1) * largest


def largest_torques(torque_table: chex.Array) -> chex.Array:
    """Largest torque about each body axis, N m: what real actions give fractions of.

    Args:
        torque_table: (actions, 3) torques, body frame, N m.

    Returns:
        (3,) N m; 0 about an axis that no torque has.

    Raises:
        ValueError: a torque is along no body axis, and so not to be had about one of them alone.

    Example:
        >>> largest_torques(default_params().torque_table).tolist()
        [0.5, 0.5, 0.5]
    """
    if checks.has_value(torque_table):
        _, second, first = np.sort(np.abs(torque_table)).T
        if np.any(skew := second > checks.ROUNDING * first):
            row = int(np.argmax(skew))
            listed = np.array2string(np.asarray(torque_table)[row], precision=3)
            raise ValueError(
                f"torque_table has {listed} in row {row}; for continuous actions each torque must "
                f"be along a body axis"
            )
    return jnp.max(jnp.abs(torque_table), axis=0)


def step(
    state: EnvState,
    action: chex.Numeric,
    params: EnvParams | None = None,
    frameskip: int = 20,
    kinematic_factor: float = 0.5,
    actions: str | None = None,
) -> EnvState:
    """One agent step of one spacecraft: pure, keyless, without reset or end of episode.

    Args:
        state: the spacecraft before the step.
        action: integer scalar, row of the torque table (Table 1); or (3,) real, as
            :func:`applied_torque` says.
        params: spacecraft, the paper's by default; they also say whether its torques are held.
        frameskip: RK4 steps after the first (static); if ``params.frameskip`` says how many, the
            most there may be.
        kinematic_factor: what stands in place of Eq. 9's ½ (static).
        actions: "discrete" or "continuous", to take only integers or only fractions.

    Returns:
        The state (1 + frameskip)/240 s later.

    Raises:
        ValueError: a shape, a type or a value is not as said; values are only checked outside
            ``jit`` and ``vmap``, where an action beyond the table is the nearest one.

    Example:
        >>> goal = EnvState(jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3), 0)
        >>> round(float(step(goal, 1).angular_velocity[0]), 6)   # 0.5 N m for 1/240 s
        0.002389
    """
    frameskip = operator.index(frameskip)  # NumPy's own could overflow
    params = default_params(frameskip) if params is None else params
    check_params(params, frameskip)
    check_share("kinematic_factor", kinematic_factor)
    action = checks.decision(action, len(params.torque_table), actions)
    quaternion = checks.unit_quaternion("quaternion", state.quaternion)
    angular_velocity = checks.real("angular_velocity", state.angular_velocity, (3,))
    moving = quaternion, angular_velocity, applied_torque(action, params), params.inertia
    have_values = all(map(checks.has_value, jax.tree.leaves((moving, params.frameskip))))
    agent_step = AgentStep(frameskip, params.torque_held, kinematic_factor)
    take = _compiled_take if have_values else propagation.take
    quaternion, angular_velocity = take(agent_step, *moving, params.frameskip)
    return EnvState(quaternion, angular_velocity, state.time + 1)


_compiled_take = jax.jit(propagation.take, static_argnames="agent_step")
"""For steps outside ``jit`` and ``vmap``, each of which would compile its loops anew."""
