"""The agent step of one spacecraft."""

import operator

import chex
import jax

from attjax import checks
from attjax.dynamics import propagation
from attjax.dynamics.integration import AgentStep
from attjax.envs.parameters import EnvParams, EnvState, check_params, default_params
from attjax.envs.torques import actuated
from attjax.values import check_share


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
        params: spacecraft, the paper's by default, and whether its torques are held.
        frameskip: RK4 steps after the first (static), or the most that ``params.frameskip`` says.
        kinematic_factor: what stands in place of Eq. 9's ½ (static).
        actions: "discrete" or "continuous", to take only integers or only fractions.

    Returns:
        The state (1 + frameskip)/240 s later.

    Raises:
        ValueError: a shape, a type or a value is not as said; values are only checked outside
            ``jit`` and ``vmap``, where an action beyond the table is the nearest one.

    Example:
        >>> import jax.numpy as jnp
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
    rate = checks.real("angular_velocity", state.angular_velocity, (3,))
    torque = actuated(state, action, params, frameskip)
    agent_step = AgentStep(frameskip, params.torque_held, kinematic_factor)
    moving = quaternion, rate, torque, params.inertia, params.frameskip, params.disturbance
    have_values = all(map(checks.has_value, jax.tree.leaves((moving, state))))
    move = _compiled_move if have_values else _moved
    return EnvState(*move(agent_step, state, *moving))


def _moved(agent_step, state, *moving):
    """Quaternion, angular velocity, time and plant after the step."""
    time = state.time + 1
    if state.plant is None:
        return *propagation.take(agent_step, *moving), time, None
    quaternion, rate, torque, _, steps_after, disturbance = moving
    if disturbance is not None:
        raise ValueError("params.disturbance is for the ideal world; a world has its own")
    plant = state.plant.commanded(torque, state.time)
    moved = plant.moved(agent_step, quaternion, rate, state.time, steps_after)
    return *moved[:2], time, moved[2]


_compiled_move = jax.jit(_moved, static_argnums=0)
"""For steps outside ``jit`` and ``vmap``, each of which would compile its loops anew."""
