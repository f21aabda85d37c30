"""How far it is to the goal for a spacecraft that can turn about two axes alone.

Two torques turn a body anywhere, about one axis after the other: by Euler's angles, 90° forth and
back about one for any turn about the axis that is dead; or, to turn by a small angle δ, round a
square whose area it is, which takes 4 √δ. The lengths here are of turns from rest to rest.
"""

import chex
import jax.numpy as jnp

from attjax.dynamics import quaternion as quaternions

DEAD = 0.02
"""Share of the strongest axis's torque below which an axis is taken to be dead."""

SMALL = 0.5
"""Cosine of half of the largest turn that is taken to be small, 120°."""

LEAST = 1e-20
"""Keeps roots and quotients of nothing finite."""


def angle_to_turn(quaternion: chex.Array, torque_table: chex.Array) -> chex.Array:
    """Angle to turn by to the goal, rad: the error angle, if no axis is dead.

    If one is, the least sum of angles of turns about the two others: of three, or, of less than
    120°, of four by what holds for small ones. More turns may be shorter, if seldom (3 in 1,000).

    Args:
        quaternion: (4,) error quaternion, scalar last.
        torque_table: (actions, 3) torques, along body axes, N m.

    Example:
        >>> table = jnp.array([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 0.0]])
        >>> third = jnp.array([0.0, 0.0, 0.6, 0.8])
        >>> round(float(angle_to_turn(third, table) - 2 * jnp.arcsin(0.6)), 4)   # and 90°, twice
        3.1416
        >>> round(float(angle_to_turn(third, table.at[2, 2].set(0.1)) - 2 * jnp.arcsin(0.6)), 4)
        0.0
    """
    is_dead = dead_axes(torque_table)
    x, y, z, scalar = quaternion
    first, second = (
        jnp.where(is_dead[0], a, jnp.where(is_dead[1], b, c)) for a, b, c in ((y, z, x), (z, x, y))
    )
    third = jnp.where(is_dead[0], x, jnp.where(is_dead[1], y, z))
    by_two = jnp.minimum(
        _by_euler(scalar, first, second, third), _by_euler(scalar, second, first, third)
    )
    size = jnp.sqrt(x**2 + y**2 + z**2 + LEAST)
    turn = 2 * jnp.arctan2(size, scalar) / size
    round_it = _round_an_area(turn * first, turn * second, turn * third)
    by_two = jnp.where(scalar > SMALL, jnp.minimum(by_two, round_it), by_two)
    return jnp.where(jnp.any(is_dead), by_two, quaternions.error_angle(quaternion))


def dead_axes(torque_table: chex.Array) -> chex.Array:
    """(3,) bool, the body axes about which there is next to no torque."""
    most = jnp.max(abs(torque_table), axis=0)
    return most <= DEAD * jnp.max(most)


def _by_euler(scalar, first, second, third):
    """|a| + |b| + |c| of turns by a about the first axis, b about the second, c about the first."""
    between = 2 * jnp.arctan2(
        jnp.sqrt(second**2 + third**2 + LEAST), jnp.sqrt(scalar**2 + first**2 + LEAST)
    )
    half_sum = abs(jnp.arctan2(first, scalar))
    half_difference = abs(jnp.arctan2(third, second + LEAST**0.5))  # has a slope at rest, too
    half_difference = jnp.minimum(half_difference, jnp.pi - half_difference)  # or b the other way
    return between + 2 * jnp.maximum(half_sum, half_difference)


def _round_an_area(x, y, area):
    """Least |dx| + |dy| of a way from (0, 0) to (x, y) that has such an area to its chord.

    Blachère, Colloq. Math. 95 (2003), 21, with numbers in place of words: of small turns, this is
    the length of those about two axes, and the area is the turn about the third.
    """
    y, area = jnp.where(area < 0, -y, y), abs(area)
    is_steep = abs(y) > abs(x)  # quarter turns, until x ≥ |y|
    x, y = jnp.where(is_steep, y, x), jnp.where(is_steep, -x, y)
    x, y = jnp.where(x < 0, -x, x), jnp.where(x < 0, -y, y)
    corner = area + x * y / 2
    square = jnp.maximum(corner - jnp.minimum(x * y, 0), 0)
    round_a_square = 4 * jnp.sqrt(square + LEAST) - x - abs(y)
    past_the_corner = x - y + 2 * jnp.maximum(corner, 0) / jnp.maximum(x, LEAST**0.5)
    straight = x + abs(y)
    beside = jnp.where(corner <= jnp.maximum(x * y, 0), straight, past_the_corner)
    return jnp.where(x <= jnp.sqrt(square), round_a_square, beside)
