"""A policy as StableHLO, by ``jax.export``. Needs flatbuffers, of the extra ``onnx``.

To call it in Python, on any platform of PLATFORMS, with nothing but JAX and flatbuffers:

    import jax.export
    policy = jax.export.deserialize(open("attjax_policy.jax", "rb").read())
    action, logits = policy.call(quaternion, angular_velocity)

with a float32 unit error quaternion (4,), scalar last, and a float32 angular velocity (3,) in the
body frame, rad/s; ``action`` is an int32 scalar, and ``logits`` (actions,) are -1e9 where masked.
``attjax_policy.stablehlo`` is the same program as StableHLO bytecode, for other compilers.
"""

import functools

import flatbuffers  # noqa: F401  jax.export needs it only when it writes; fail here instead
import jax
import jax.export
import jax.numpy as jnp

from attjax import flight_policy
from attjax.flight_policy import FlightPolicy

FILES = ("attjax_policy.jax", "attjax_policy.stablehlo")
PLATFORMS = ("cpu", "cuda")


def files(flight: FlightPolicy, seed: int = 0) -> dict[str, bytes]:
    """The content of each of FILES; there are no test vectors for a seed to draw."""
    del seed
    decide = jax.jit(functools.partial(flight_policy.decide, flight))
    shapes = (jax.ShapeDtypeStruct((size,), jnp.float32) for size in (4, 3))
    exported = jax.export.export(decide, platforms=PLATFORMS)(*shapes)
    contents = (bytes(exported.serialize()), bytes(exported.mlir_module_serialized))
    return dict(zip(FILES, contents))
