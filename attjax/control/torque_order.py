"""The torques that a policy for any spacecraft chooses from, in an order that names do not change.

Axes are ordered by the momentum that a turn about each takes, and levels by their size; which way
about an axis is called forward is exchanged as the state says.
"""

import dataclasses

import chex
import jax.numpy as jnp
import numpy as np

from attjax.control.triad import dot, shape
from attjax.dynamics.numerics import across
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.context import Context
from attjax.envs.way import DEAD
from attjax.spacecraft import Spacecraft

AXES, LEVELS = 3, 3
ACTIONS = 1 + 2 * LEVELS * AXES
"""Torques that are chosen from: none, and each level about each axis in both directions."""

DEAD_LEVEL = 1e-4
"""Share of the largest torque below which a level has been identified to do nothing."""

ABOUT = 1 - 1e-5
"""Share of a moment below which another one is less, whatever the rounding of both."""

FLATTEST = 1e-3
"""Volume that unit vectors along the axes must span, at least."""


def rows(context: Context) -> chex.Array:
    """(ACTIONS,) rows of a spacecraft's torque table: those that are chosen from, in order.

    Axes are in ascending order of momentum, one that is dead is the last; levels are the largest,
    the one nearest to the middle of their logarithms, and the smallest that is not dead. Of fewer
    than three, one stands more than once.

    Raises:
        ValueError: the table is not one of three torque axes.

    Example:
        >>> from attjax import AttitudeEnv
        >>> env = AttitudeEnv(frameskip=5)
        >>> rows(env.context(env.default_params))[:7].tolist()   # y, z and x, up and down
        [0, 3, 4, 5, 6, 1, 2]
    """
    count = len(context.torque_table) - 1
    if count % (2 * AXES):
        raise ValueError(f"the spacecraft has {count + 1} actions; they must be of {AXES} axes")
    directions, levels, dead = axes_and_levels(context.torque_table)
    moments = jnp.diagonal(shape(directions, context.inertia))
    of_axis = 2 * _order(jnp.where(dead, jnp.inf, moments))[:, None] + jnp.arange(2)
    of_level = 2 * AXES * _three_of(levels)[:, None, None]
    return jnp.concatenate([jnp.zeros(1, jnp.int32), (1 + of_level + of_axis).reshape(-1)])


def is_crippled(context: Context) -> chex.Array:
    """Whether the torques about an axis are dead: a bool."""
    return jnp.any(axes_and_levels(context.torque_table)[2])


def alive(context: Context) -> chex.Array:
    """(ACTIONS,) bool, those that are not about a dead axis, of torques in their order."""
    is_of_last = np.arange(-1, ACTIONS - 1) // 2 % AXES == AXES - 1
    is_of_last[0] = False
    return ~(is_crippled(context) & is_of_last)


def turned_back(outputs: chex.Array, backward: chex.Array) -> chex.Array:
    """Numbers of ACTIONS, of which those up and down about some axes have changed places.

    Args:
        outputs: (ACTIONS, samples), in the order of :func:`rows`.
        backward: (samples, 3) bool, whether they changed about each axis.

    Returns:
        (ACTIONS, samples) with all in their own places.

    Example:
        >>> outputs = jnp.arange(19)[:, None]
        >>> turned_back(outputs, jnp.array([[True, False, False]]))[:7, 0].tolist()
        [0, 2, 1, 3, 4, 5, 6]
    """
    of_axes = outputs[1:].reshape(LEVELS, AXES, 2, -1)
    of_axes = jnp.where(backward.T[:, None], of_axes[:, :, ::-1], of_axes)
    return jnp.concatenate([outputs[:1], of_axes.reshape(ACTIONS - 1, -1)])


def check_axes(spacecraft: Spacecraft) -> None:
    """Check that a spacecraft has units of its own.

    Raises:
        ValueError: it has more or fewer than three torque axes, or they lie in a plane.
    """
    axes = np.array(spacecraft.torque_axes, float)
    if len(axes) != AXES:
        raise ValueError(
            f"{spacecraft} has {len(axes)} torque_axes; universal inputs are for {AXES}"
        )
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    if abs(np.linalg.det(axes)) < FLATTEST:
        raise ValueError(f"{spacecraft} has torque_axes in a plane; universal inputs need a space")


def in_order(spacecraft: Spacecraft) -> Spacecraft:
    """The spacecraft with the torques of :func:`rows` alone, in that order.

    Raises:
        ValueError: as :func:`check_axes`.

    Example:
        >>> from attjax import LM50
        >>> in_order(LM50).torque_axes
        ((0, 1, 0), (0, 0, 1), (1, 0, 0))
    """
    check_axes(spacecraft)
    env = AttitudeEnv(0, spacecraft=spacecraft)
    chosen = np.asarray(rows(env.context(env.default_params))) - 1
    levels = [spacecraft.torque_levels[n // (2 * AXES)] for n in chosen[1 :: 2 * AXES]]
    axes = [
        tuple(x if n % 2 == 0 else -x for x in spacecraft.torque_axes[n // 2])
        for n in chosen[1 : 1 + 2 * AXES : 2] % (2 * AXES)
    ]
    return dataclasses.replace(spacecraft, torque_levels=tuple(levels), torque_axes=tuple(axes))


def ordered(context: Context) -> Context:
    """The context with the torques of :func:`rows` alone, in that order."""
    return dataclasses.replace(context, torque_table=context.torque_table[rows(context)])


def _three_of(levels):
    """(3,) numbers of the largest level, of one between, and of the smallest that is not dead.

    Of equal ones the first is the largest and the last the smallest: what is in order stays in it.
    """
    first = jnp.argmax(levels)
    is_dead = levels < DEAD_LEVEL * levels[first]
    last = len(levels) - 1 - jnp.argmin(jnp.where(is_dead, jnp.inf, levels)[::-1])
    if len(levels) <= 2:
        return jnp.stack([first, last, last])
    logarithms = jnp.log(levels)
    between = abs(logarithms - 0.5 * (logarithms[first] + logarithms[last]))
    numbers = jnp.arange(len(levels))
    is_out = (numbers == first) | (numbers == last) | is_dead
    middle = jnp.argmin(jnp.where(is_out, jnp.inf, between))
    return jnp.stack([first, jnp.where(jnp.all(is_out), last, middle), last])


def _order(moments):
    """(3,) numbers of the axes in their order, those of about equal moments as they stand."""
    values, numbers = list(moments), [jnp.int32(axis) for axis in range(AXES)]
    for n in (0, 1, 0):  # neighbours change places
        is_less = values[n + 1] < ABOUT * values[n]
        for row in (values, numbers):
            first, second = row[n : n + 2]
            row[n], row[n + 1] = jnp.where(
                is_less, jnp.stack([second, first]), jnp.stack([first, second])
            )
    return jnp.stack(numbers)


def axes_and_levels(torque_table: chex.Array) -> tuple[chex.Array, chex.Array, chex.Array]:
    """(3, 3) directions, a row each, (levels,) largest torques along them, N m, and who is dead.

    They are unit vectors, but where the axes have been identified to be of different strength.
    """
    up = torque_table[1::2].reshape(-1, AXES, 3)
    sizes = jnp.sqrt(up[..., 0] ** 2 + up[..., 1] ** 2 + up[..., 2] ** 2)
    levels = jnp.max(sizes, axis=1)
    largest = jnp.argmax(levels)
    directions, dead = up[largest] / levels[largest], sizes[largest] <= DEAD * levels[largest]
    both = across(directions)
    lengths = jnp.sqrt(jnp.stack([dot(axis, axis) for axis in both]))
    unit = both / jnp.where(dead, lengths, 1)[:, None]
    return jnp.where(dead[:, None], unit, directions), levels, dead
