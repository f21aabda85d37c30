"""Exported policies decide as JAX does; export.py writes them, or says in one line why not."""

import ctypes
import functools
import re

import exported
import jax
import numpy as np
import pytest
from bodies import rotated_inertia
from commands import ROOT, export_script, one_line_error
from exported import needs_compiler, random_states

from attjax.export import c as export_c
from attjax.export import flight_check
from attjax.export.flight_policy import FlightPolicy
from attjax.spacecraft import Spacecraft

PRECISE = ROOT / "pretrained" / "precise"
STATES = 20_000


@functools.cache
def precise(frameskip):
    return exported.load(PRECISE, frameskip)


@functools.cache
def flown(frameskip):
    return flight_check.flown_decisions(precise(frameskip), 3, 100, STATES // 100)


@functools.cache
def c_files(frameskip):
    return export_c.files(precise(frameskip), seed=0)


WHEELS = Spacecraft(
    name="four wheels",
    inertia=tuple(map(tuple, rotated_inertia().tolist())),
    torque_levels=(0.1, 0.01),
    torque_axes=((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)),
    torque_held=True,
    duration=6.0,
)
SKEW = Spacecraft(
    name="skew",
    inertia=WHEELS.inertia,
    torque_levels=(0.2, 0.1, 0.01),
    torque_axes=((1, 0.2, 0), (0, -1, 0.1), (0.3, 0, 1)),
    torque_held=True,
    duration=6.0,
)
OTHERS = [
    ("state", (24, 8), 0.0),
    ("state", (16,), 0.99),
    ("multiscale", (8, 8, 8), 0.0),
    ("multiscale", (16,), 0.99, WHEELS),
    ("universal", (8, 8), 0.99),
    ("universal", (16,), 0.99, SKEW),
    ("universal", (16,), 0.99, Spacecraft(torque_levels=(0.4,))),
]


def cases():
    """Policies with states to compare at: the pretrained one at two rates, and others."""
    yield from ((precise(frameskip), flown(frameskip)) for frameskip in (5, 20))
    for case in OTHERS:
        yield exported.untrained(*case), random_states(exported.untrained(*case))


def test_states_are_of_many_kinds():
    for flight, states in cases():
        assert np.mean(states.clear) > 0.99
        assert len(np.unique(states.action)) >= 7, flight.policy
    masked = random_states(exported.untrained("state", (16,), 0.99)).logits < -1e8
    assert 0.05 < np.mean(masked) < 0.95


@needs_compiler
def test_c_decides_as_jax(tmp_path):
    for number, (flight, states) in enumerate(cases()):
        folder = tmp_path / str(number)
        folder.mkdir()
        exported.write(folder, export_c.policy_files(flight))
        assert exported.differing(states, exported.c_actions(folder, states))[0] == 0


@needs_compiler
def test_c_logits_are_those_of_jax(tmp_path):
    exported.write(tmp_path, c_files(5))
    library, states, logits = exported.library(tmp_path), flown(5), np.zeros(19, np.float32)
    for row in range(0, STATES, 500):
        inputs = states.quaternion[row].copy(), states.angular_velocity[row].copy()
        library.attjax_logits(*(ctypes.c_void_p(x.ctypes.data) for x in (*inputs, logits)))
        allowed = states.logits[row] > -1e8
        np.testing.assert_allclose(logits[allowed], states.logits[row][allowed], atol=2e-3)


@needs_compiler
@pytest.mark.parametrize("frameskip", [5, 20])
def test_the_c_test_program_passes_and_flies_table_5_as_jax(tmp_path, frameskip):
    exported.write(tmp_path, c_files(frameskip))
    printed = exported.run_test_program(tmp_path)
    assert "500 of 500 decisions" in printed and "14 of 14" in printed
    assert printed.endswith("passed\n")
    errors = re.findall(r"at the end ([\d.]+) deg, in attjax ([\d.]+)", printed)
    assert len(errors) == 3
    for in_c, in_jax in np.array(errors, float):
        assert in_c == pytest.approx(in_jax, abs=2e-6) and in_c < 0.001


@needs_compiler
def test_the_c_test_program_flies_another_spacecraft_as_jax(tmp_path):
    """A tensor of inertia, other torques than along the axes, held through the control period."""
    exported.write(
        tmp_path, export_c.files(exported.untrained("multiscale", (16,), 0.99, WHEELS), seed=0)
    )
    printed = exported.run_test_program(tmp_path, status=1)  # it has learned nothing
    errors = re.findall(r"the end ([\d.]+) deg, in attjax ([\d.]+); rate ([\d.]+)", printed)
    for in_c, in_jax, rate in np.array(errors, float):
        assert in_c == pytest.approx(in_jax, abs=2e-6) and rate > 0.01
    assert len(errors) == 3 and "four wheels" in (tmp_path / "attjax_policy.h").read_text()


@needs_compiler
@pytest.mark.parametrize("wrong", ["decisions", "torques"])
def test_the_c_test_program_notices_what_is_wrong(tmp_path, wrong):
    contents = c_files(5)
    source = contents["attjax_policy.c"]
    if wrong == "decisions":  # the last action that is allowed
        spoilt = source.replace("logits[a] > logits[best]", "a > best")
    else:  # thrusters that turn the spacecraft the wrong way
        table, rest = source.split("weights_1", 1)
        spoilt = table.replace("0.5f", "-0.5f").replace("--", "") + "weights_1" + rest
    assert spoilt != source
    exported.write(tmp_path, contents | {"attjax_policy.c": spoilt})
    assert exported.run_test_program(tmp_path, status=1).endswith("FAILED\n")


@needs_compiler
@pytest.mark.parametrize(
    "case",
    [
        ("state", (24, 8), 0.0),
        ("multiscale", (8, 8, 8), 0.0),
        ("state", (8,), 0.99),
        ("universal", (8,), 0.99),
    ],
)
def test_constants_and_stack_are_as_the_comment_says(tmp_path, case):
    """All the constants of the C source, added up by the compiler."""
    flight = exported.untrained(*case)
    contents = export_c.policy_files(flight)
    arrays = re.findall(r"^(?:static )?const float (\w+)\[", contents["attjax_policy.c"], re.M)
    total = " + ".join(f"sizeof({name})" for name in arrays)
    check = f"\ntypedef char as_said[({total}) == {export_c.constant_bytes(flight)} ? 1 : -1];\n"
    contents["attjax_policy.c"] += check
    exported.compile_c(exported.write(tmp_path, contents), "-c", "attjax_policy.c")
    assert f"{export_c.constant_bytes(flight)} bytes" in contents["attjax_policy.h"]


def test_exports_are_the_same_each_time():
    assert export_c.files(precise(5), seed=0) == c_files(5)
    assert export_c.test_files(precise(5), seed=1) != export_c.test_files(precise(5), seed=0)


def assert_decided_as_jax(states, action, logits):
    assert exported.differing(states, action)[0] == 0
    clear = states.clear
    np.testing.assert_allclose(logits[clear], states.logits[clear], rtol=1e-4, atol=2e-3)


def test_onnx_decides_as_jax():
    export_onnx = pytest.importorskip("attjax.export.onnx", exc_type=ImportError)
    pytest.importorskip("onnxruntime")
    for flight, states in cases():
        model = export_onnx.files(flight)[export_onnx.FILES[0]]
        assert_decided_as_jax(states, *exported.onnx_outputs(model, states))


def test_stablehlo_decides_as_jax():
    export_stablehlo = pytest.importorskip("attjax.export.stablehlo", exc_type=ImportError)
    for flight, states in cases():
        program = export_stablehlo.files(flight)[export_stablehlo.FILES[0]]
        assert_decided_as_jax(states, *exported.stablehlo_outputs(program, states))


def test_export_writes_only_its_own_files(tmp_path, capsys):
    out = tmp_path / "flight"
    out.mkdir()
    for name in ("main.c", "attjax_policy.c"):
        (out / name).write_text("mine")
    arguments = ["--checkpoint", str(PRECISE), "--format", "c", "--out", str(out), "--device=cpu"]
    error = one_line_error(export_script.main, arguments, capsys)
    assert "holds attjax_policy.c already" in error and "--overwrite" in error
    assert {path.read_text() for path in out.iterdir()} == {"mine"}
    assert export_script.main([*arguments, "--overwrite", "--frameskip", "20"]) == 0
    assert {path.name for path in out.iterdir()} == {"main.c", *export_c.FILES}
    assert (out / "main.c").read_text() == "mine"
    header = (out / "attjax_policy.h").read_text()
    assert "CONTROL_PERIOD 0.0875f" in header
    assert "preset precise with num_envs 2048, seed 2, update 306" in header


def test_bad_export_arguments(tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("text")
    good = {"--checkpoint": PRECISE, "--format": "c", "--out": tmp_path / "out"}
    for flag, value, named in (
        ("--format", "fortran", "stablehlo"),
        ("--frameskip", -1, "frameskip is -1"),
        ("--checkpoint", tmp_path / "no", "there is no checkpoint folder"),
        ("--checkpoint", tmp_path, "no attjax checkpoint"),
        ("--out", file, "cannot be written"),
        ("--out", file / "below", "cannot be written"),
        ("--out", "/proc/nowhere", "cannot be written"),
    ):
        flags = [str(x) for pair in (good | {flag: value}).items() for x in pair]
        assert named in one_line_error(export_script.main, [*flags, "--device", "cpu"], capsys)
    for missing in ("--format", "--out"):
        flags = [str(x) for pair in good.items() if pair[0] != missing for x in pair]
        assert missing in one_line_error(export_script.main, flags, capsys)
    assert {path.name for path in tmp_path.iterdir()} == {"file"}


def test_a_missing_extra_is_named(tmp_path, capsys, monkeypatch):
    def import_module(name):
        raise ModuleNotFoundError("No module named 'onnx'", name="onnx")

    monkeypatch.setattr(export_script.importlib, "import_module", import_module)
    arguments = ["--checkpoint", str(PRECISE), "--format", "onnx", "--out", str(tmp_path / "x")]
    error = one_line_error(export_script.main, [*arguments, "--device", "cpu"], capsys)
    assert "pip install 'attjax[onnx]'" in error


def test_policies_that_cannot_fly_are_refused():
    flight = exported.untrained("state", (16,), 0.99)
    broken = jax.tree.map(lambda x: x * np.nan, flight.params)
    with pytest.raises(ValueError, match="not finite"):
        FlightPolicy(flight.policy, broken, flight.env, flight.origin)
