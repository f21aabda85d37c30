"""Checks of arrays that users hand in: one line that names the array and what is allowed.

Shapes and types are always checked. Values are checked where there are any: inside ``jit`` and
``vmap`` arrays have none yet.
"""

import operator
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np

from attjax.values import check_moments

UNIT_TOLERANCE = 1e-3
"""Largest ‖q‖ − 1 that is taken for rounding."""

ROUNDING = 1e-5
"""Of an inertia, relatively: arrays are of single precision, and so are a tensor's moments."""


def has_value(x: Any) -> bool:
    """Whether an array has a value, rather than standing for one while JAX traces."""
    return not isinstance(x, jax.core.Tracer)


def real(
    name: str,
    x: Any,
    *shapes: tuple[int | None, ...],
    low: chex.Numeric | None = None,
    above: chex.Numeric | None = None,
) -> chex.Array:
    """Return x as an array of floating-point numbers, finite, of one of the shapes and in range.

    Args:
        name: what the error calls it.
        x: anything that ``jnp.asarray`` takes.
        shapes: that are allowed; None stands for any length.
        low, above: smallest value, or an exclusive limit.

    Raises:
        ValueError: it is something else.

    Example:
        >>> real("rate_limit", -0.5, (), above=0)
        Traceback (most recent call last):
        ValueError: rate_limit is -0.5; it must be above 0
    """
    x = _array(name, x)
    if not jnp.issubdtype(x.dtype, jnp.floating):
        raise ValueError(f"{name} has type {x.dtype}; it must be floating-point")
    _check_shape(name, x.shape, shapes)
    if has_value(x):
        values = np.asarray(x)
        if not np.all(np.isfinite(values)):
            raise ValueError(f"{name} is {_shown(values)}; it must be finite")
        if low is not None and not np.all(values >= low):
            raise ValueError(f"{name} is {_shown(values)}; it must be at least {low}")
        if above is not None and not np.all(values > above):
            raise ValueError(f"{name} is {_shown(values)}; it must be above {above}")
    return x


def integer(name: str, x: Any, low: int, high: int) -> chex.Array:
    """Return x as an integer scalar from low to high.

    Raises:
        ValueError: it is something else.
    """
    x = _array(name, x)
    if not jnp.issubdtype(x.dtype, jnp.integer):
        raise ValueError(f"{name} has type {x.dtype}; it must be an integer")
    _check_shape(name, x.shape, [()])
    if has_value(x) and not low <= np.asarray(x) <= high:
        raise ValueError(f"{name} is {x}; it must be from {low} to {high}")
    return x


def decision(x: Any, count: int, kind: str | None = None) -> chex.Array:
    """Return x as an action: an integer scalar from 0 to count − 1, or (3,) real fractions.

    Args:
        x: anything that ``jnp.asarray`` takes.
        count: rows of the torque table.
        kind: "discrete" or "continuous": only the integer, or only the fractions.

    Raises:
        ValueError: it is something else.
    """
    x = _array("action", x)
    if kind == "continuous":
        return real("action", x, (3,))
    if kind is None and jnp.issubdtype(x.dtype, jnp.floating):
        if x.shape != (3,):
            raise ValueError(
                f"action has type {x.dtype}; it must be an integer, or have shape (3,) and not "
                f"{x.shape}"
            )
        return real("action", x, (3,))
    return integer("action", x, 0, count - 1)


def action(x: Any, count: int) -> int:
    """Return x, or the one element of an array, as an integer from 0 to count − 1.

    For steps from Python.

    Raises:
        ValueError: it is something else.
    """
    try:
        x = operator.index(x.reshape(())[()] if getattr(x, "shape", ()) == (1,) else x)
    except TypeError:
        raise ValueError(f"action is {x!r}; it must be an integer") from None
    if not 0 <= x < count:
        raise ValueError(f"action is {x}; it must be from 0 to {count - 1}")
    return x


def actions(x: Any, batch: int, count: int) -> np.ndarray:
    """Return x as (batch,) integers from 0 to count − 1, int32, for steps from Python.

    Raises:
        ValueError: they are something else.
    """
    x = np.asarray(x)
    if x.shape != (batch,) or not np.issubdtype(x.dtype, np.integer):
        raise ValueError(
            f"actions has shape {x.shape} and type {x.dtype}; it must be ({batch},) integers"
        )
    for extreme in (x.min(), x.max()):
        if not 0 <= extreme < count:
            raise ValueError(f"actions holds {extreme}; each must be from 0 to {count - 1}")
    return x.astype(np.int32)


def fractions(name: str, x: Any, shape: tuple[int, ...]) -> np.ndarray:
    """Return x as fractions of the largest torques, float32, clipped to [−1, 1].

    For steps from Python.

    Raises:
        ValueError: it is no array of finite real numbers of that shape.
    """
    x = np.asarray(x)
    is_real = np.issubdtype(x.dtype, np.integer) or np.issubdtype(x.dtype, np.floating)
    if x.shape != shape or not is_real:
        raise ValueError(
            f"{name} has shape {x.shape} and type {x.dtype}; it must be {shape} real numbers"
        )
    if not np.all(np.isfinite(x)):
        raise ValueError(f"{name} is {_shown(x)}; it must be finite")
    return np.clip(x, -1, 1).astype(np.float32)


def unit_quaternion(name: str, x: Any) -> chex.Array:
    """Return x as a unit quaternion (4,).

    Raises:
        ValueError: it is something else.
    """
    x = real(name, x, (4,))
    if has_value(x):
        length = np.linalg.norm(np.asarray(x, float))
        if abs(length - 1) > UNIT_TOLERANCE:
            raise ValueError(f"{name} has length {length:.6g}; it must be 1")
    return x


def inertia(x: Any) -> chex.Array:
    """Return x as the inertia of a rigid body, (3,) principal moments or (3, 3), kg m².

    Of a body with mass, the moments are positive and none is larger than the other two
    together.

    Raises:
        ValueError: it is something else.
    """
    x = real("inertia", x, (3,), (3, 3))
    if has_value(x):
        values = np.asarray(x, float)
        rounding = ROUNDING * np.max(np.abs(values))
        if values.ndim == 2 and not np.allclose(values, values.T, rtol=0, atol=rounding):
            raise ValueError(f"inertia is {_shown(values)}; it must be symmetric")
        moments = np.sort(values if values.ndim == 1 else np.linalg.eigvalsh(values))
        if moments[0] <= 0:
            raise ValueError(
                f"inertia has principal moments {_shown(moments)}; they must be positive"
            )
        check_moments(moments, ROUNDING)
    return x


def _array(name, x):
    try:
        return jnp.asarray(x)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {type(x).__name__}; it must be an array of numbers") from None


def _check_shape(name, shape, allowed):
    def fits(pattern):
        return len(shape) == len(pattern) and all(b in (None, a) for a, b in zip(shape, pattern))

    if not any(map(fits, allowed)):
        listed = " or ".join(str(pattern).replace("None", "n") for pattern in allowed)
        raise ValueError(f"{name} has shape {shape}; it must be {listed}")


def _shown(values):
    if values.ndim == 0:
        return f"{values:.6g}"
    return " ".join(np.array2string(values, precision=6, threshold=12).split())
