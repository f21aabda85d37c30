"""Exports a policy in every format and compares it with JAX over many states of real slews.

For each control rate: whether C, ONNX and StableHLO decide as JAX does, what the C test program
says of the slews of Table 5, and the C export's size, operations and time.

Example:
    python tests/helpers/exported.py --checkpoint pretrained/precise --states 100000
"""

import argparse
import ctypes
import functools
import shutil
import subprocess
import tempfile
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from attjax import AttitudeEnv
from attjax.control import torque_order
from attjax.evaluation import paper
from attjax.export import c as export_c
from attjax.export import flight_check, provenance
from attjax.export.discrete import Decisions
from attjax.export.flight_policy import FlightPolicy
from attjax.ppo.networks import Policy
from attjax.runs import build, checkpoint
from attjax.runs import folder as run_folder
from attjax.spacecraft import LM50

SLEWS = 400
STRICT = ("-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Werror")


def load(folder: Path, frameskip: int) -> FlightPolicy:
    """The newest policy of a run folder, to fly at this rate."""
    policy, params = checkpoint.restore_network(folder)
    config, update = run_folder.read_config(folder), checkpoint.latest(folder)
    is_universal = policy.features == "universal"
    craft = torque_order.in_order(config.spacecraft) if is_universal else config.spacecraft
    env = AttitudeEnv(frameskip, spacecraft=craft)
    return FlightPolicy(policy, params, env, provenance.of_run(config, update, update))


@functools.cache
def untrained(features, hidden_sizes, rate_margin, spacecraft=LM50) -> FlightPolicy:
    """Random weights, and biases too, that leave the decision to the state."""
    spacecraft = torque_order.in_order(spacecraft) if features == "universal" else spacecraft
    policy = Policy(features, hidden_sizes, spacecraft.num_actions, rate_margin)
    shapes = jax.eval_shape(lambda: build.initial_parameters(policy)["policy"])
    leaves, tree = jax.tree.flatten(shapes)
    rng = np.random.default_rng(5)
    leaves = [rng.normal(0, (0.1, 1.0)[x.ndim - 1], x.shape).astype(np.float32) for x in leaves]
    params, env = (
        {"policy": jax.tree.unflatten(tree, leaves)},
        AttitudeEnv(10, spacecraft=spacecraft),
    )
    return FlightPolicy(policy, params, env, provenance.Origin("no training"))


def compiler(language: str = "c") -> str | None:
    """The compiler of C or C++, if there is one."""
    names = {"c": ("cc", "gcc"), "c++": ("c++", "g++")}[language]
    return next(filter(None, map(shutil.which, names)), None)


needs_compiler = pytest.mark.skipif(compiler() is None, reason="there is no C compiler")


@functools.cache
def random_states(flight):
    """Decisions at random attitudes and at rates below and above the limit."""
    rng = np.random.default_rng(0)
    quaternion = rng.normal(size=(2000, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    return flight_check.decisions(flight, quaternion, rng.normal(0, 0.25, (2000, 3)))


def write(folder: Path, contents: dict) -> Path:
    """Write the files of an export."""
    for name, content in contents.items():
        data = content if isinstance(content, bytes) else content.encode()
        (folder / name).write_bytes(data)
    return folder


def compile_c(folder: Path, *flags, language: str = "c") -> None:
    """Run the compiler of C99 or C++11 strictly; fails on any warning."""
    standard = {"c": ["-std=c99"], "c++": ["-std=c++11", "-x", "c++"]}[language]
    command = [compiler(language), *standard, *STRICT, *map(str, flags)]
    result = subprocess.run([*command, "-lm"], cwd=folder, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def run_test_program(folder: Path, *flags, language: str = "c", status: int = 0) -> str:
    """Compile attjax_test.c and run it; returns what it prints."""
    sources = "attjax_test.c", "attjax_policy.c"
    compile_c(folder, "-O2", *flags, *sources, "-o", "attjax_test", language=language)
    result = subprocess.run([folder / "attjax_test"], capture_output=True, text=True, timeout=60)
    assert result.returncode == status, result.stdout
    return result.stdout


def library(folder: Path) -> ctypes.CDLL:
    """The C policy as a shared library."""
    compile_c(folder, "-O2", "-shared", "-fPIC", "attjax_policy.c", "-o", "attjax_policy.so")
    return ctypes.CDLL(str(folder / "attjax_policy.so"))


def c_actions(folder: Path, states: Decisions) -> np.ndarray:
    """What attjax_decide of the C export in the folder decides."""
    decide, pointer = library(folder).attjax_decide, ctypes.c_void_p
    quaternion, angular_velocity = states.quaternion, states.angular_velocity
    q, w = quaternion.ctypes.data, angular_velocity.ctypes.data
    rows = range(len(quaternion))
    return np.array([decide(pointer(q + 16 * i), pointer(w + 12 * i)) for i in rows])


def onnx_outputs(model: bytes, states: Decisions) -> list[np.ndarray]:
    """Actions and logits by ONNX Runtime."""
    import onnxruntime

    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    inputs = {"quaternion": states.quaternion, "angular_velocity": states.angular_velocity}
    return session.run(["action", "logits"], inputs)


def stablehlo_outputs(serialized: bytes, states: Decisions) -> list[np.ndarray]:
    """Actions and logits of the deserialised program, state by state."""
    import jax.export

    call = jax.export.deserialize(bytearray(serialized)).call

    @jax.jit
    def run(quaternion, angular_velocity):
        return jax.lax.map(lambda state: call(*state), (quaternion, angular_velocity))

    return [np.asarray(x) for x in run(states.quaternion, states.angular_velocity)]


def stablehlo_main(bytecode: bytes):
    """The module of the bytecode, and its function main."""
    from jaxlib.mlir import ir
    from jaxlib.mlir.dialects import stablehlo

    context = ir.Context()
    stablehlo.register_dialect(context)
    module = stablehlo.deserialize_portable_artifact(context, bytecode)
    return module, next(op for op in module.body.operations if op.name.value == "main")


def bytecode_actions(bytecode: bytes, states: Decisions) -> np.ndarray:
    """Actions of main(quaternion, angular velocity), which XLA compiles without JAX's layers."""
    from jaxlib import xla_client

    client, devices = jax.devices("cpu")[0].client, tuple(jax.devices("cpu")[:1])
    text = str(stablehlo_main(bytecode)[0])
    compiled = client.compile_and_load(
        text, xla_client.DeviceList(devices), xla_client.CompileOptions()
    )
    actions = []
    for state in zip(states.quaternion, states.angular_velocity):
        arguments = [jax.device_put(x, devices[0]) for x in state]
        results = compiled.execute_sharded(arguments).disassemble_into_single_device_arrays()
        actions.append(int(np.asarray(results[0][0])))
    return np.array(actions)


def differing(states: Decisions, actions) -> tuple[int, int]:
    """How many actions differ from JAX's where the decision is clear, and elsewhere."""
    differ = np.asarray(actions) != states.action
    return int(np.sum(differ & states.clear)), int(np.sum(differ & ~states.clear))


def main(argv=None) -> int:
    """Compare and print; returns 0 if all clear decisions agree."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--checkpoint", type=Path, default=Path("pretrained/precise"))
    parser.add_argument("--states", type=int, default=100_000, help="a multiple of 400")
    parser.add_argument("--frameskips", type=int, nargs="+", default=[5, 20])
    parser.add_argument("--seed", type=int, default=1, help="of the slews")
    arguments = parser.parse_args(argv)
    failures = sum(_report(arguments, frameskip) for frameskip in arguments.frameskips)
    return int(failures > 0)


def _report(arguments, frameskip):
    from attjax.export import onnx as export_onnx
    from attjax.export import stablehlo as export_stablehlo

    flight = load(arguments.checkpoint, frameskip)
    states = flight_check.flown_decisions(flight, arguments.seed, SLEWS, arguments.states // SLEWS)
    print(f"frameskip {frameskip}: {len(states.clear):,} states of {SLEWS} slews")
    with tempfile.TemporaryDirectory() as scratch:
        folder = write(Path(scratch), export_c.files(flight, seed=0))
        actions = {"c": c_actions(folder, states)}
        printed = run_test_program(folder), run_test_program(folder, "-O3", "-march=native")
    model = export_onnx.files(flight)[export_onnx.FILES[0]]
    actions["onnx"] = onnx_outputs(model, states)[0]
    program = export_stablehlo.files(flight)[export_stablehlo.FILES[0]]
    actions["stablehlo"] = stablehlo_outputs(program, states)[0]
    unclear = int(np.sum(~states.clear))
    wrong = 0
    for name, chosen in actions.items():
        clear, tied = differing(states, chosen)
        print(f"  {name}: {clear} clear decisions differ; {tied} of {unclear} ties do")
        wrong += clear
    for options, text in zip(("-O2", "-O3 -march=native"), printed):
        print(f"  C test program, {options}:\n    " + text.strip().replace("\n", "\n    "))
    print(f"  all in float32 in JAX: {_in_float32(flight)} deg")
    print(
        f"  constants {export_c.constant_bytes(flight):,} B, stack {export_c.stack_bytes(flight)} B"
    )
    print(f"  operations {export_c.operations(flight)}")
    return wrong


def _in_float32(flight):
    """Terminal errors of Table 5 as eval.py flies: spacecraft and policy in float32."""
    from attjax import evaluation
    from attjax.dynamics import quaternion

    params = flight.env.default_params
    act = jax.tree_util.Partial(flight.policy.act, flight.params)
    start, steps = paper.table_5_slews(), int(params.max_steps_in_episode)
    history = evaluation.record(act, flight.env, params, jax.random.key(0), start, steps)
    angles = jnp.rad2deg(jax.vmap(quaternion.error_angle)(history.quaternion[-1]))
    return ", ".join(f"{angle:.6f}" for angle in angles.tolist())


if __name__ == "__main__":
    raise SystemExit(main())
