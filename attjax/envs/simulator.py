"""One spacecraft: its state, its parameters (Table 1, section 2.3) and the agent step."""

import dataclasses
import operator

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax import checks, dynamics
from attjax.dynamics import quaternion as quaternions
from attjax.spacecraft import LM50, Spacecraft


@struct.dataclass
class EnvState:
    """State of one spacecraft.

    Attributes:
        quaternion: (4,) error quaternion, scalar last.
        angular_velocity: (3,) body frame, rad/s.
        time: agent steps since the start of the episode, int32.
    """

    quaternion: chex.Array
    angular_velocity: chex.Array
    time: chex.Array


@struct.dataclass
class EnvParams:
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
    if not isinstance(params.torque_held, bool):
        raise ValueError(f"params.torque_held is {params.torque_held!r}; it must be True or False")


def initial_state(key: chex.PRNGKey, params: EnvParams) -> EnvState:
    """A spacecraft at rest, turned by a uniform angle about a uniformly distributed axis."""
    return _slew(jax.random.uniform(key, (3,), params.inertia.dtype), params)


def _slew(u, params):
    """The slew that three uniform numbers stand for."""
    axis = _direction(u[:2])
    angle = params.min_slew_angle + u[2] * (params.max_slew_angle - params.min_slew_angle)
    return EnvState(
        quaternion=quaternions.from_axis_angle(axis, angle),
        angular_velocity=jnp.zeros_like(axis),
        time=jnp.zeros((), jnp.int32),
    )


@dataclasses.dataclass(frozen=True)
class NearGoalStarts:
    """Initial states for training: some episodes start near the goal, moving, and end soon.

    Angle and rate of those are log-uniform, down to 1e-6 rad and 2.5e-6 rad/s, in random
    directions. So the learner practises the last decades from the first update on, not only
    once it can steer there. They start late in the episode, ``steps`` before the time limit,
    and never at time 0, by which :func:`starts_whole` tells whole episodes.

    Attributes:
        share: of the episodes that start near the goal; the others are as the paper's.
        steps: agent steps that such an episode lasts.
    """

    share: float
    steps: int

    def __call__(self, key: chex.PRNGKey, params: EnvParams) -> EnvState:
        """Draw one; the signature of :func:`initial_state`."""
        u = jax.random.uniform(key, (10,), params.inertia.dtype)
        angle, rate = 10.0 ** (-6 * u[0]), 0.5 * params.rate_limit * 10.0 ** (-5 * u[1])
        near = EnvState(
            quaternion=quaternions.from_axis_angle(_direction(u[2:4]), angle),
            angular_velocity=rate * _direction(u[4:6]),
            time=jnp.maximum(params.max_steps_in_episode - self.steps, 1),  # not whole
        )
        slew = _slew(u[7:], params)
        return jax.tree.map(lambda a, b: jnp.where(u[6] < self.share, a, b), near, slew)


def starts_whole(state: EnvState) -> chex.Array:
    """Whether the episode that begins with this state is one of the task's, of full length.

    The others are practice from the middle of it: near the goal, as of :class:`NearGoalStarts`,
    or cut short. What they come to says nothing of the task.

    Args:
        state: the first of the episode, or a batch of them.

    Returns:
        A bool for each state.

    Example:
        >>> start = initial_state(jax.random.key(0), default_params())
        >>> bool(starts_whole(start)), bool(starts_whole(start.replace(time=400)))
        (True, False)
    """
    return jnp.asarray(state.time) == 0


def _direction(u):
    """A uniformly distributed unit vector (3,) from two uniform numbers."""
    cosine, azimuth = 2 * u[0] - 1, 2 * jnp.pi * u[1]
    sine = jnp.sqrt(1 - cosine**2)
    return jnp.stack([sine * jnp.cos(azimuth), sine * jnp.sin(azimuth), cosine])


def applied_torque(action: chex.Array, params: EnvParams) -> chex.Array:
    """The torque that an action gives: the one way from a decision to what turns the spacecraft.

    Args:
        action: integer scalar, row of the torque table (Table 1).
        params: of the spacecraft.

    Returns:
        (3,) torque, body frame, N m, for as long as the environment's context says.

    Example:
        >>> applied_torque(3, default_params()).tolist()
        [0.0, 0.5, 0.0]
    """
    return params.torque_table[action]


def step(
    state: EnvState,
    action,
    params: EnvParams | None = None,
    frameskip: int = 20,
) -> EnvState:
    """One agent step of one spacecraft: pure, keyless, without reset or end of episode.

    Args:
        state: the spacecraft before the step.
        action: integer scalar, row of the torque table (Table 1).
        params: spacecraft, the paper's by default; they also say whether its torques are held.
        frameskip: RK4 steps after the first (static); if ``params.frameskip`` says how many, the
            most there may be.

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
    action = checks.integer("action", action, 0, len(params.torque_table) - 1)
    quaternion = checks.unit_quaternion("quaternion", state.quaternion)
    angular_velocity = checks.real("angular_velocity", state.angular_velocity, (3,))
    moving = quaternion, angular_velocity, applied_torque(action, params), params.inertia
    have_values = all(map(checks.has_value, jax.tree.leaves((moving, params.frameskip))))
    propagate = _compiled_propagate if have_values else dynamics.propagate
    moved = propagate(*moving, frameskip, params.frameskip, params.torque_held)
    return EnvState(*moved, state.time + 1)


_compiled_propagate = jax.jit(dynamics.propagate, static_argnames=("frameskip", "held"))
"""For steps outside ``jit`` and ``vmap``, each of which would compile its loops anew."""
