"""A spacecraft in units of its own, in which near the goal all spacecraft are the same.

Let aⱼ be the directions of three torque axes, J the largest impulse about one of them and h the
control period. With Iω = J Σ pⱼ aⱼ, the largest impulse adds 1 to one pⱼ, whatever the inertia and
the axes. With I θ = J h Σ yⱼ aⱼ, where θ is the turn to the goal, near it y grows by p in a period.
Torques that last for d move it by p d/2h less; z = y + p d/2h grows as if they came at once.

Spacecraft that differ in the names of their axes alone are the same, too: the axes are put into an
order, by the momentum that a turn about each takes, and so are the torques; and so are states that
differ in which way is called forward about an axis.
"""

import dataclasses
from typing import NamedTuple

import chex
import jax.numpy as jnp
import numpy as np

from attjax.envs.attitude import AttitudeEnv
from attjax.envs.context import Context
from attjax.spacecraft import Spacecraft

AXES, LEVELS = 3, 3
ACTIONS = 1 + 2 * LEVELS * AXES
"""Torques that are chosen from: none, and each level about each axis in both directions."""

DEAD = 1e-4
"""Share of the largest torque below which one has been identified to do nothing."""

FLATTEST = 1e-3
"""Volume that unit vectors along the axes must span, at least."""


class OwnUnits(NamedTuple):
    """What a spacecraft's own units are made of.

    Attributes:
        momentum: (3, 3) p = momentum ω, 1/(rad/s).
        directions: (3, 3) unit vectors of the torque axes, a row each, body frame.
        shape: (3, 3) symmetric: p of a turn of 1 rad/s about each axis of the reciprocal basis,
            which are the torque axes where these are at right angles.
        levels: (2,) second and third level of torque as shares of the first.
        period, duration: of control and of a torque, s.
        rate_limit: rad/s.
    """

    momentum: chex.Array
    directions: chex.Array
    shape: chex.Array
    levels: chex.Array
    period: chex.Numeric
    duration: chex.Numeric
    rate_limit: chex.Array

    @property
    def hand(self) -> chex.Array:
        """1 where the axes are right-handed, else -1."""
        return jnp.where(_dot(self.directions[0], _across(self.directions)[0]) < 0, -1, 1)

    @classmethod
    def of(cls, context: Context) -> "OwnUnits":
        """The units of a spacecraft with ACTIONS torques in the order of Table 1.

        Example:
            >>> from attjax import AttitudeEnv
            >>> env = AttitudeEnv(frameskip=5)
            >>> units = OwnUnits.of(env.context(env.default_params))
            >>> round(float(0.5 / 240 / 0.872 * units.momentum[0, 0]), 6)   # the largest pulse
            1.0
        """
        directions, levels = _axes_and_levels(context.torque_table)
        onto_axes = _reciprocal(directions)
        impulse = levels[0] * context.torque_duration
        momentum = _product(onto_axes, _tensor(context.inertia)) / impulse
        return cls(
            momentum=momentum,
            directions=directions,
            shape=_product(momentum, onto_axes.T),
            levels=levels[1:] / levels[0],
            period=context.control_period,
            duration=context.torque_duration,
            rate_limit=context.rate_limit,
        )


def rows(context: Context) -> chex.Array:
    """(ACTIONS,) rows of a spacecraft's torque table: those that are chosen from, in order.

    Axes are in ascending order of momentum; levels are the largest, the one nearest to the middle
    of their logarithms, and the smallest that is not dead. Of fewer than three, one stands more
    than once.

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
    directions, levels = _axes_and_levels(context.torque_table)
    of_axis = 2 * _order(_shape(directions, context.inertia))[:, None] + jnp.arange(2)
    of_level = 2 * AXES * _three_of(levels)[:, None, None]
    return jnp.concatenate([jnp.zeros(1, jnp.int32), (1 + of_level + of_axis).reshape(-1)])


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
    """(3,) numbers of the largest level, of one between, and of the smallest that is not dead."""
    first = jnp.argmax(levels)
    is_dead = levels < DEAD * levels[first]
    last = jnp.argmin(jnp.where(is_dead, jnp.inf, levels))
    if len(levels) <= 2:
        return jnp.stack([first, last, last])
    logarithms = jnp.log(levels)
    between = abs(logarithms - 0.5 * (logarithms[first] + logarithms[last]))
    numbers = jnp.arange(len(levels))
    is_out = (numbers == first) | (numbers == last) | is_dead
    middle = jnp.argmin(jnp.where(is_out, jnp.inf, between))
    return jnp.stack([first, jnp.where(jnp.all(is_out), last, middle), last])


def _order(shape):
    """(3,) numbers of the axes in their order."""
    moments, numbers = jnp.diagonal(shape), np.arange(AXES)
    is_less = moments[None, :] < moments[:, None]
    is_tied = (moments[None, :] == moments[:, None]) & (numbers[None, :] < numbers[:, None])
    rank = jnp.sum(is_less | is_tied, axis=1)
    return jnp.argmax(rank[None, :] == numbers[:, None], axis=1).astype(jnp.int32)


def _axes_and_levels(torque_table):
    """(3, 3) directions, a row each, and the (levels,) largest torques along them, N m.

    They are unit vectors, but where the axes have been identified to be of different strength.
    """
    up = torque_table[1::2].reshape(-1, AXES, 3)
    sizes = jnp.sqrt(up[..., 0] ** 2 + up[..., 1] ** 2 + up[..., 2] ** 2)
    levels = jnp.max(sizes, axis=1)
    largest = jnp.argmax(levels)
    return _alive(up[largest] / levels[largest]), levels


def _alive(directions):
    """The directions; in place of one that does nothing, a weak one across both others."""
    squared = jnp.stack([_dot(axis, axis) for axis in directions])
    return jnp.where(squared[:, None] < DEAD**2, DEAD * _across(directions), directions)


def _shape(directions, inertia):
    onto_axes = _reciprocal(directions)
    return _product(_product(onto_axes, _tensor(inertia)), onto_axes.T)


def _tensor(inertia):
    return jnp.diag(inertia) if inertia.ndim == 1 else inertia


def _product(a, b):
    return jnp.matmul(a, b, precision="highest")


def _reciprocal(directions):
    """The matrix whose product with Σ pⱼ aⱼ is p."""
    rows = _across(directions)
    return rows / _dot(directions[0], rows[0])


def _across(directions):
    """(3, 3) the cross product of the two other directions, in cyclic order, for each: rows."""
    a, b, c = directions
    return jnp.stack([jnp.cross(b, c), jnp.cross(c, a), jnp.cross(a, b)])


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
