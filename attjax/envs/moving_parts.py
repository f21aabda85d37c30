"""What moves aboard in a world, drawn for one episode."""

import math

import chex
import jax.numpy as jnp

from attjax.dynamics import numerics
from attjax.dynamics.draws import Draws
from attjax.dynamics.moving_parts import FlexibleMode, Motors, Wheels
from attjax.world import Flexible
from attjax.world import Wheels as DescribedWheels


def drawn_motors(wheels: DescribedWheels | None, draws: Draws, gains: chex.Array) -> Motors | None:
    """The motors of reaction wheels; None where there are none.

    Args:
        wheels: their description.
        draws: of the episode.
        gains: (axes,) of the commanded torques.
    """
    if wheels is None:
        return None
    limit, band = wheels.most_torque, wheels.dead_band
    return Motors(
        gains=tuple(gains),
        most_torque=None if limit is None else draws.number("wheels.most_torque", limit),
        dead_band=draws.number("wheels.dead_band", band) if band != 0 else None,
    )


def drawn_wheels(
    wheels: DescribedWheels | None, draws: Draws, axes: chex.Array
) -> tuple[Wheels | None, chex.Array | None]:
    """Reaction wheels, and (axes,) their speeds at the start, rad/s; None where there are none.

    Args:
        wheels: their description.
        draws: of the episode.
        axes: (axes, 3) unit vectors, body frame.
    """
    if wheels is None:
        return None, None
    limit, coulomb, viscous = wheels.most_speed, wheels.coulomb_friction, wheels.viscous_friction
    drawn = Wheels(
        axes=tuple(map(tuple, axes)),
        inertia=draws.number("wheels.inertia", wheels.inertia),
        most_speed=None if limit is None else draws.number("wheels.most_speed", limit),
        coulomb=draws.number("wheels.coulomb_friction", coulomb) if coulomb != 0 else None,
        viscous=draws.number("wheels.viscous_friction", viscous) if viscous != 0 else None,
    )
    return drawn, draws.number("wheels.start_speed", wheels.start_speed, (len(axes),))


def drawn_flexible(
    flexible: Flexible | None, draws: Draws
) -> tuple[FlexibleMode | None, chex.Array | None]:
    """A flexible mode, and (2,) η and η̇ at the start, zeros; None where there is none."""
    if flexible is None:
        return None, None
    frequency, damping, participation = (
        draws.number(f"flexible.{x}", getattr(flexible, x))
        for x in ("frequency", "damping", "participation")
    )
    axis = draws.direction("flexible.axis")
    if flexible.axis is not None:
        axis = numerics.unit(jnp.array(flexible.axis, draws.dtype))
    rate = 2 * math.pi * frequency
    mode = FlexibleMode(tuple(participation * axis), rate**2, 2 * damping * rate)
    return mode, jnp.zeros(2, draws.dtype)
