"""One spacecraft: its state, its parameters and what they may be (Table 1, section 2.3)."""

import dataclasses
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax import checks
from attjax.dynamics.sensing import Measurement
from attjax.envs.plant import Plant
from attjax.spacecraft import INTEGRATION_STEP, LM50, Spacecraft
from attjax.values import check_truth


class EnvState(struct.PyTreeNode):
    """State of one spacecraft.

    Attributes:
        quaternion: (4,) error quaternion, scalar last.
        angular_velocity: (3,) body frame, rad/s.
        time: agent steps since the start of the episode, int32.
        plant: what flies in a world that is not perfect; None in the paper's.
    """

    quaternion: chex.Array
    angular_velocity: chex.Array
    time: chex.Array
    plant: Plant | None = None


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
        disturbance: (3,) torque that always acts, body frame, N m, and is known; in the ideal world
            only. None: there is none.
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
    disturbance: chex.Array | None = None
    torque_held: bool = struct.field(pytree_node=False, default=False)


def measured(state: EnvState) -> Measurement:
    """What the sensors say of a state; without any, the truth.

    Example:
        >>> state = EnvState(jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3), 0)
        >>> measured(state).quaternion.tolist()
        [0.0, 0.0, 0.0, 1.0]
    """
    always, plant = jnp.asarray(True), state.plant
    told = Measurement(state.quaternion, always, state.angular_velocity, always)
    if plant is None:
        return told
    told = told if plant.sensing is None else plant.sensing.told
    told = told.replace(wheel_speeds=plant.wheel_speeds)
    for number, sensor in enumerate(plant.own_sensors):
        key = jax.random.fold_in(jax.random.wrap_key_data(plant.key), state.time)
        told = sensor.told(told, state, jax.random.fold_in(key, number))
    return told


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


def control_period(params: EnvParams, frameskip: int) -> chex.Array:
    """Time between two actions, s, at this frameskip or the parameters' own.

    Example:
        >>> round(control_period(default_params(), 20).item(), 6)
        0.0875
    """
    frameskip = frameskip if params.frameskip is None else params.frameskip
    rk4_steps = jnp.asarray(1 + frameskip, jnp.asarray(params.inertia).dtype)
    return rk4_steps * INTEGRATION_STEP


AXES = {"inertia": 2, "torque_table": 2, "disturbance": 1}
"""Of the parameters of one spacecraft that are no numbers, at most."""


def fleet_axes(params: EnvParams) -> EnvParams:
    """For ``vmap``: 0 where the spacecraft of a fleet differ, in None of the other parameters.

    Those have a leading axis, and an inertia that differs is (spacecraft, 3, 3).

    Example:
        >>> limits = default_params().replace(rate_limit=jnp.array([0.3, 0.5]))
        >>> fleet_axes(limits).rate_limit, fleet_axes(limits).inertia
        (0, None)
    """
    given = {f.name: getattr(params, f.name) for f in dataclasses.fields(params)}
    axes = {
        name: 0 if np.ndim(x) > AXES.get(name, 0) else None
        for name, x in given.items()
        if name != "torque_held"
    }
    return params.replace(**axes)


def of_fleet(params: EnvParams, rows: Any) -> EnvParams:
    """The parameters of one spacecraft of a fleet, by its row, or of several, by a slice."""
    axes = fleet_axes(params)
    return jax.tree.map(lambda x, axis: x if axis is None else x[rows], params, axes)


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
    if params.disturbance is not None:
        checks.real("params.disturbance", params.disturbance, (3,))
    check_truth("params.torque_held", params.torque_held)
