"""How compiled programs share their work out to devices, or to CPU cores as devices."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec

AXIS = "devices"
SHARED, SPLIT = PartitionSpec(), PartitionSpec(AXIS)
"""What is the same on all devices, and what is split along its first axis."""

COMPILER_OPTIONS = {"xla_cpu_prefer_vector_width": 512}
"""For outermost jitted functions only: JAX refuses options on a function called in another."""

RUN_ONCE = {"xla_backend_optimization_level": 0}
"""The same for a program that runs once, for which the shortest compilation is the best."""

_others: ContextVar[Sequence[jax.Device] | None] = ContextVar("others", default=None)


@contextlib.contextmanager
def compiled_for(others: Sequence[jax.Device]) -> Iterator[None]:
    """Programs are lowered for these devices meanwhile, which need not be there.

    Only those that were not traced before: JAX keeps what it has traced, devices and all.
    """
    token = _others.set(others)
    try:
        yield
    finally:
        _others.reset(token)


def devices() -> Sequence[jax.Device]:
    """Those of JAX's default platform, or of :func:`compiled_for`."""
    return _others.get() or jax.devices()


def mesh(num_devices: int) -> Mesh:
    """The first devices, as one axis."""
    return Mesh(np.array(devices()[:num_devices]), (AXIS,))


def shared(tree: Any, num_devices: int) -> Any:
    """The same arrays on the first devices, wherever they are: saved ones are put on one of them.

    JAX refuses a program for several devices arguments that were put on one.
    """
    return jax.device_put(tree, NamedSharding(mesh(num_devices), SHARED))


def on_devices(num_devices: int, function: Callable, in_specs: Any, out_specs: Any) -> Callable:
    """``function`` on each device's part of its arguments, with the axis AXIS.

    Args:
        num_devices: the first so many of JAX's default platform.
        function: of arrays or pytrees of them.
        in_specs, out_specs: SHARED, SPLIT or pytrees of such, of its arguments and results.
    """
    return jax.shard_map(
        function,
        mesh=mesh(num_devices),
        in_specs=in_specs,
        out_specs=out_specs,
        check_vma=False,
    )
