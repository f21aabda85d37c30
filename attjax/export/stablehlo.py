"""A policy as StableHLO, by ``jax.export``. Needs flatbuffers, of the extra ``onnx``.

To call it in Python, on any platform of PLATFORMS, with nothing but JAX and flatbuffers:

    import jax.export
    policy = jax.export.deserialize(open("attjax_policy.jax", "rb").read())
    action, logits = policy.call(quaternion, angular_velocity)

with a float32 unit error quaternion (4,), scalar last, and a float32 angular velocity (3,) in the
body frame, rad/s; ``action`` is an int32 scalar, and ``logits`` (actions,) are -1e9 where masked.
Where actions are continuous, the call gives the torque alone, (3,) float32, body frame, N m.
Numbers that are not finite are not looked for. ``attjax_policy.stablehlo`` is the same program as
StableHLO bytecode, for other compilers: its ``main`` takes the quaternion and the angular velocity
and nothing else. Both have the hash of the parameters in the name of their function, and
``attjax_policy.txt`` says where the policy comes from and what it was trained for.
"""

import contextlib
import functools
from collections.abc import Callable

import flatbuffers  # noqa: F401  jax.export needs it only when it writes; fail here instead
import jax
import jax.export
import jax.numpy as jnp

from attjax.export import c_names, flight_policy
from attjax.export.flight_policy import FlightPolicy

FILES = ("attjax_policy.jax", "attjax_policy.stablehlo", "attjax_policy.txt")
PLATFORMS = ("cpu", "cuda")


def files(
    flight: FlightPolicy, seed: int = 0, prefix: str = c_names.PREFIX
) -> dict[str, bytes | str]:
    """The content of each of FILES, by its name with the prefix; no test vectors need a seed."""
    del seed
    names = [c_names.renamed(name, c_names.check(prefix)) for name in FILES]
    # A program for several platforms is told on which it runs, by an argument more.
    program, bytecode = _export(flight, PLATFORMS), _export(flight, PLATFORMS[:1])
    contents = (bytes(program.serialize()), bytes(bytecode.mlir_module_serialized), _text(flight))
    return dict(zip(names, contents))


def _export(flight, platforms):
    decide: Callable = functools.partial(flight_policy.decide, flight)
    decide.__name__ = f"attjax_policy_{flight_policy.parameter_hash(flight.params)}"
    shapes = (jax.ShapeDtypeStruct((size,), jnp.float32) for size in (4, 3))
    with _no_source_lines():
        return jax.export.export(jax.jit(decide), platforms=platforms)(*shapes)


@contextlib.contextmanager
def _no_source_lines():
    """Let no program name the folders of the machine that wrote it."""
    name = "jax_traceback_in_locations_limit"
    before = getattr(jax.config, name)
    jax.config.update(name, 0)
    try:
        yield
    finally:
        jax.config.update(name, before)


def _text(flight):
    state = {
        "quaternion": "float32 (4,), unit error quaternion, scalar last",
        "rate": "float32 (3,), angular velocity in the body frame, rad/s",
    }
    return _lines(flight.facts) + "\n" + _lines(state | flight.kind.results(flight))


def _lines(items):
    return "".join(f"{name + ':':<13}{line}\n" for name, line in items.items())
