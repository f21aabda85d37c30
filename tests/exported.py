"""Exports a policy in every format and compares it with JAX over many states of real slews.

For each control rate: whether C, ONNX and StableHLO decide as JAX does, what the C test program
says of the slews of Table 5, and the C export's size, operations and time.

Example:
    python tests/exported.py --checkpoint pretrained/precise --states 100000
"""

import argparse
import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from attjax import AttitudeEnv, checkpoint, export_c, flight_policy, run_folder
from attjax.flight_policy import Decisions, FlightPolicy

SLEWS = 400
STRICT = ("-std=c99", "-Wall", "-Wextra", "-pedantic", "-Wconversion", "-Werror")


def load(folder: Path, frameskip: int) -> FlightPolicy:
    """The newest policy of a run folder, to fly at this rate."""
    policy, params = checkpoint.restore_network(folder)
    env = AttitudeEnv(frameskip, spacecraft=run_folder.read_config(folder).spacecraft)
    return FlightPolicy(policy, params, env, f"a run in {Path(folder).name}")


def compiler() -> str | None:
    """The C compiler, if there is one."""
    return shutil.which("cc") or shutil.which("gcc")


def write(folder: Path, contents: dict) -> Path:
    """Write the files of an export."""
    for name, content in contents.items():
        data = content if isinstance(content, bytes) else content.encode()
        (folder / name).write_bytes(data)
    return folder


def compile_c(folder: Path, *flags) -> None:
    """Run the compiler strictly; raises CalledProcessError on any warning."""
    command = [compiler(), *STRICT, *map(str, flags)]
    result = subprocess.run([*command, "-lm"], cwd=folder, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


def run_test_program(folder: Path, *flags) -> str:
    """Compile attjax_test.c and run it; returns what it prints."""
    compile_c(folder, "-O2", *flags, "attjax_test.c", "attjax_policy.c", "-o", "attjax_test")
    result = subprocess.run([folder / "attjax_test"], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stdout
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
    from attjax import export_onnx, export_stablehlo

    flight = load(arguments.checkpoint, frameskip)
    states = flight_policy.flown_decisions(flight, arguments.seed, SLEWS, arguments.states // SLEWS)
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
    from attjax import evaluation, quaternion

    params = flight.env.default_params
    act = jax.tree_util.Partial(flight.policy.act, flight.params)
    start, steps = evaluation.table_5_slews(), int(params.max_steps_in_episode)
    history = evaluation.record(act, flight.env, params, start, steps)
    angles = jnp.rad2deg(jax.vmap(quaternion.error_angle)(history.quaternion[-1]))
    return ", ".join(f"{angle:.6f}" for angle in angles.tolist())


if __name__ == "__main__":
    raise SystemExit(main())
