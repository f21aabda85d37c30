"""From an action to a torque: the one way from a decision to what turns the spacecraft."""

import chex
import jax.numpy as jnp
import numpy as np

from attjax import checks
from attjax.dynamics.actuators import Commands
from attjax.envs.context import Context
from attjax.envs.parameters import EnvParams, EnvState, control_period
from attjax.spacecraft import INTEGRATION_STEP, Spacecraft


def applied_torque(action: chex.Numeric, params: EnvParams | Context) -> chex.Array:
    """The torque that an action stands for.

    Args:
        action: integer scalar, row of the torque table (Table 1); or (3,) real, fractions of
            :func:`largest_torques`, clipped to [−1, 1].
        params: of the spacecraft, or the context, with its torque table.

    Returns:
        (3,) torque, body frame, N m, for as long as the environment's context says.

    Raises:
        ValueError: the action is real, and the table as :func:`largest_torques` says.

    Example:
        >>> from attjax.envs.parameters import default_params
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
        >>> from attjax.envs.parameters import default_params
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


def torque_axes(params: EnvParams, spacecraft: Spacecraft, actions: str) -> chex.Array:
    """(axes, 3) unit vectors, body frame, that amounts of torque are along.

    Args:
        params: with a torque table in the order of Table 1.
        spacecraft: whose torque axes these are.
        actions: "discrete"; or "continuous", whose axes are the body's.

    Raises:
        ValueError: the table is not one of so many axes.

    Example:
        >>> from attjax.envs.parameters import default_params
        >>> from attjax.spacecraft import LM50
        >>> torque_axes(default_params(), LM50, "discrete").tolist()
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    if actions == "continuous":
        return jnp.eye(3, dtype=params.torque_table.dtype)
    count, rows = len(spacecraft.torque_axes), len(params.torque_table) - 1
    if rows < 2 * count or rows % (2 * count):
        raise ValueError(f"torque_table has {rows + 1} rows, which {count} torque axes do not make")
    strongest = params.torque_table[1 : 1 + 2 * count : 2]
    return strongest / jnp.sqrt(jnp.sum(strongest**2, axis=1, keepdims=True))


def commanded(
    action: chex.Numeric, params: EnvParams | Context, count: int, duration: chex.Numeric
) -> Commands:
    """What an action asks of the actuators.

    Args:
        action, params: as of :func:`applied_torque`.
        count: of torque axes; of real actions they are the body's.
        duration: of a torque, s.

    Example:
        >>> from attjax.envs.parameters import default_params
        >>> commanded(10, default_params(), 3, 1 / 240).amounts.tolist()
        [0.0, -0.0..., 0.0]
    """
    if np.ndim(action) > 0:
        amounts, largest = applied_torque(action, params), largest_torques(params.torque_table)
        return Commands(amounts, jnp.asarray(-1), duration, largest)
    norms = jnp.sqrt(jnp.sum(params.torque_table**2, axis=1))
    number = jnp.maximum(jnp.asarray(action) - 1, 0)
    sign = jnp.where(number % 2 == 0, 1, -1)
    is_along = jnp.arange(count) == number // 2 % count
    amounts = jnp.where(is_along, sign * norms[action], 0)
    level = jnp.where(jnp.asarray(action) > 0, number // (2 * count), -1)
    largest = jnp.max(norms[1:].reshape(-1, count, 2), axis=(0, 2))
    return Commands(amounts, level, duration, largest)


def acting_torque(
    state: EnvState, action: chex.Numeric, params: EnvParams, frameskip: int
) -> chex.Array:
    """The torque (3,) that comes of an action, N m, body frame: :func:`applied_torque`, ideally.

    Of reaction wheels it is their motors', friction and the limit of their speed left out.

    Args:
        state: before the step.
        action, params: as of :func:`applied_torque`.
        frameskip: as of :func:`step`.
    """
    torque = actuated(state, action, params, frameskip)
    wheels = None if state.plant is None else state.plant.wheels
    return torque if wheels is None else jnp.stack(wheels.along_axes(torque))


def actuated(
    state: EnvState, action: chex.Numeric, params: EnvParams, frameskip: int
) -> chex.Array:
    """As :func:`acting_torque`; but (axes,) torques on the body along the axes of wheels."""
    plant, period = state.plant, control_period(params, frameskip)
    if plant is None or plant.actuators is None:
        torque = applied_torque(action, params)
    else:
        duration = period if params.torque_held else INTEGRATION_STEP
        commands = commanded(action, params, len(plant.actuators.directions), duration)
        torque = plant.actuators.torque(commands, state.time * period)
    for actuator in () if plant is None else plant.own_actuators:
        torque = actuator.torque(torque, state.time * period)
    return torque
