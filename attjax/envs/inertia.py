"""The inertia that flies, where it is not the one that is believed."""

import chex
import jax.numpy as jnp

from attjax.dynamics import quaternion as quaternions
from attjax.dynamics.draws import Draws
from attjax.dynamics.numerics import matmul
from attjax.world import Uncertainty


def drawn_inertia(
    uncertainty: Uncertainty | None, draws: Draws, believed: chex.Array
) -> chex.Array:
    """The inertia of an episode.

    Args:
        uncertainty: of it; None: there is none.
        draws: of the episode.
        believed: (3,) principal moments or (3, 3) tensor, kg m².

    Returns:
        The same shape; (3, 3) where the principal axes may be turned.
    """
    if uncertainty is None or uncertainty == Uncertainty():
        return believed
    is_turned = uncertainty.axes_turned_deg != 0
    moments, axes = believed, None
    if believed.ndim == 2:
        moments, axes = jnp.linalg.eigh(believed)
    factor = draws.number("inertia_factor", uncertainty.inertia_factor)
    factors = draws.number("moment_factor", uncertainty.moment_factor, (3,))
    moments = moments * factor * factors
    moments = jnp.minimum(moments, jnp.roll(moments, 1) + jnp.roll(moments, 2))
    if axes is None and not is_turned:
        return moments
    axes = jnp.eye(3, dtype=moments.dtype) if axes is None else axes
    if is_turned:
        angle = jnp.deg2rad(draws.number("axes_turned_deg", uncertainty.axes_turned_deg))
        turn = quaternions.from_axis_angle(draws.direction("axes_turned"), angle)
        axes = matmul(quaternions.rotation_matrix(turn), axes)
    return jnp.einsum("ik,k,jk->ij", axes, moments, axes, precision="highest")
