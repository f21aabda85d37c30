"""What exported files say of themselves is so: rates, parameters, spacecraft, arguments."""

import dataclasses
import functools
import hashlib
import json
import re
import shutil

import exported
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from commands import ROOT, eval_script, export_script
from exported import needs_compiler

from attjax import AttitudeEnv
from attjax.export import c as export_c
from attjax.export import flight_check, flight_policy
from attjax.export.flight_policy import FlightPolicy
from attjax.spacecraft import Spacecraft

PRECISE = ROOT / "pretrained" / "precise"


def export(checkpoint, out, *flags, format="c"):
    """Run export.py; returns the texts of what it wrote, by name."""
    arguments = ["--checkpoint", checkpoint, "--format", format, "--out", out, "--device", "cpu"]
    assert export_script.main([str(x) for x in (*arguments, *flags)]) == 0
    return {path.name: path.read_text(errors="replace") for path in out.iterdir()}


def altered_run(folder, **settings):
    """The pretrained run, as if it had been trained with other settings."""
    shutil.copytree(PRECISE, folder)
    config = json.loads((folder / "config.json").read_text())
    config["settings"] |= settings
    (folder / "config.json").write_text(json.dumps(config))
    return folder


@pytest.mark.parametrize(
    ("frameskip", "standing"),
    [
        (20, "(11.43 Hz): one of those trained"),
        (12, "(18.46 Hz): NOT TRAINED, between trained rates"),
        (239, "(1 Hz): NOT TRAINED, beyond what was trained"),
    ],
)
def test_c_files_say_whether_their_rate_was_trained(tmp_path, capsys, frameskip, standing):
    written = export(PRECISE, tmp_path, "--frameskip", frameskip)
    for name, text in written.items():
        said = text[: text.index("*/")]
        assert "frameskips 5, 7, 10, 14, 20 (40, 30, 21.82, 16, 11.43 Hz); at no other" in said, (
            name
        )
        assert f"frameskip {frameskip} {standing}" in said
        assert ("NOT TRAINED" in said) == ("overridden:  nothing" not in said)
    warnings = capsys.readouterr().err.splitlines()
    expected = f"export.py: warning: frameskip {frameskip} was not trained; the run trained"
    assert [x.startswith(expected) for x in warnings] == [True] * ("NOT" in standing)


def test_onnx_and_stablehlo_say_the_same():
    flight = exported.load(PRECISE, 12)
    export_onnx = pytest.importorskip("attjax.export.onnx", exc_type=ImportError)
    export_stablehlo = pytest.importorskip("attjax.export.stablehlo", exc_type=ImportError)
    model = export_onnx.model(flight)
    assert {x.key: x.value for x in model.metadata_props} == flight.facts
    text = export_stablehlo.files(flight)["attjax_policy.txt"]
    for name, line in flight.facts.items():
        assert f"{name}: {line}" in model.doc_string
        assert re.search(f"^{name}: +{re.escape(line)}$", text, re.M)
    assert "NOT TRAINED" in flight.facts["exported at"] and "12" in flight.facts["overridden"]


def test_frameskip_defaults_to_one_that_was_trained(tmp_path, capsys):
    for number, (trained, chosen) in enumerate((([20, 10], 10), ([3, 7], 3), ([20, 5], 5))):
        run = altered_run(tmp_path / f"run{number}", frameskips=trained)
        written = export(run, tmp_path / f"out{number}")
        assert f"frameskip {chosen} (" in written["attjax_policy.h"]
        arguments = ["--checkpoint", str(run), "--episodes", "2", "--device", "cpu"]
        assert eval_script.main(arguments) == 0
        captured = capsys.readouterr()
        assert f"(frameskip {chosen})" in captured.out and captured.err == ""


def test_evaluation_warns_of_a_rate_that_was_not_trained(capsys):
    flags = ["--episodes", "2", "--duration", "1", "--device", "cpu", "--frameskip", "6"]
    assert eval_script.main(["--checkpoint", str(PRECISE), *flags]) == 0
    captured = capsys.readouterr()
    assert captured.err.startswith("eval.py: warning: frameskip 6 was not trained")
    assert captured.err.count("\n") == 1 and "(frameskip 6)" in captured.out
    assert eval_script.main(["--controller", "feedback", *flags]) == 0
    assert capsys.readouterr().err == ""


def test_what_was_overridden_is_said(tmp_path):
    run = altered_run(tmp_path / "run", rollout_length=32, passes=5)
    shutil.copytree(run / "306", run / "310")
    (run / "306" / "metrics").mkdir()
    (run / "306" / "metrics" / "metrics").write_text('{"terminal_error_deg": 0.5}')
    header = export(run, tmp_path / "out", "--best")["attjax_policy.h"]
    said = " ".join(header.replace("\n *", " ").split())
    changed = "num_envs 2048, rollout_length 32, passes 5"
    assert f"preset precise with {changed}, seed 2, update 306 of 611" in said
    assert "overridden: update 306, not the newest, 310" in said
    assert "overridden:  nothing" in export(run, tmp_path / "newest")["attjax_policy.h"]
    flight = exported.load(PRECISE, 5)
    other = dataclasses.replace(flight.env.spacecraft, name="LM51", inertia=(0.9, 0.1, 0.9))
    flown = FlightPolicy(
        flight.policy, flight.params, AttitudeEnv(5, spacecraft=other), flight.origin
    )
    header = export_c.policy_files(flown)["attjax_policy.h"]
    assert "the spacecraft, which is not as trained" in header and "LM51" in header


def c_constants(source, name):
    """The float32 numbers of a table in C source."""
    table = re.search(rf" {name}\[.*?= {{(.*?)}};", source, re.S)[1]
    return np.array([x.strip().rstrip("f") for x in table.split(",")], np.float32)


def test_the_hash_is_that_of_the_constants_to_the_bit():
    flight = exported.untrained("state", (24, 8), 0.0)
    params = jax.tree.map(np.array, flight.params)
    kernel = params["policy"]["params"]["Dense_0"]["kernel"]
    kernel[0, :4] = -0.0, 1e-45, np.finfo(np.float32).max, 1 / 3
    flight = FlightPolicy(flight.policy, params, flight.env, flight.origin)
    files = export_c.policy_files(flight)
    digest = hashlib.sha256()
    for number, layer in enumerate(flight.layers, 1):
        for name, exact in (("weights", layer.weights), ("biases", layer.biases)):
            values = c_constants(files["attjax_policy.c"], f"{name}_{number}")
            assert values.tobytes() == exact.tobytes()
            digest.update(values.astype("<f4").tobytes())
    for text in files.values():
        assert f"SHA-256 {digest.hexdigest()[:16]} " in text


def test_the_hash_does_not_hang_on_the_platform():
    params = exported.load(PRECISE, 5).params
    assert flight_policy.parameter_hash(params) == "1012034e910ba99f"
    for kind in (">f4", "<f8"):
        turned = jax.tree.map(functools.partial(np.asarray, dtype=kind, order="F"), params)
        assert flight_policy.parameter_hash(turned) == "1012034e910ba99f"
    other = jax.tree.map(lambda x: np.nextafter(np.asarray(x), np.float32(9)), params)
    assert flight_policy.parameter_hash(other) != "1012034e910ba99f"


@needs_compiler
def test_the_c_test_program_fails_where_the_loop_does_not_point(tmp_path):
    export(PRECISE, tmp_path, "--frameskip", 239)
    printed = exported.run_test_program(tmp_path, status=1)
    assert "500 of 500 decisions as in attjax" in printed  # it does what it does in attjax
    assert printed.count("FAILED: the goal is an error of 0.25 deg at most") == 3
    assert printed.endswith("FAILED\n")


@needs_compiler
def test_the_c_test_program_fails_where_the_rate_limit_is_passed(tmp_path):
    header = export(PRECISE, tmp_path)["attjax_policy.h"]
    lower = header.replace("RATE_LIMIT 0.5f", "RATE_LIMIT 0.1f")
    assert lower != header
    (tmp_path / "attjax_policy.h").write_text(lower)
    printed = exported.run_test_program(tmp_path, status=1)
    assert printed.count("passes the limit of 0.1") == 3 and printed.endswith("FAILED\n")


@needs_compiler
def test_a_flight_that_does_not_converge_is_no_success(tmp_path):
    """Its error is no number, in C as in JAX."""
    wild = Spacecraft(
        inertia=(0.002, 1, 1.001), torque_levels=(48,), torque_held=True, rate_limit=100
    )
    flight = exported.untrained("state", (16,), 0.0, wild)
    assert np.isnan(flight_check.fly_table_5(flight).error_deg).any()
    exported.write(tmp_path, export_c.files(flight, seed=0))
    assert exported.run_test_program(tmp_path, status=1).endswith("FAILED\n")


@pytest.mark.parametrize("angles", [(5, 20), (120, 150), (30, 150)])
def test_the_c_test_program_flies_slews_that_are_the_spacecrafts_task(angles):
    craft = Spacecraft(slew_angles_deg=angles, duration=1)
    slews = flight_check.fly_table_5(exported.untrained("state", (16,), 0.99, craft))
    turned = np.rad2deg(2 * np.arccos(slews.quaternion[:, 3]))
    np.testing.assert_allclose(turned, np.clip(100, *angles), atol=1e-3)


def test_the_bytecode_takes_a_state_and_nothing_else():
    export_stablehlo = pytest.importorskip("attjax.export.stablehlo", exc_type=ImportError)
    flight = exported.load(PRECISE, 5)
    bytecode = export_stablehlo.files(flight)["attjax_policy.stablehlo"]
    module, main = exported.stablehlo_main(bytecode)
    signature = "(tensor<4xf32>, tensor<3xf32>) -> (tensor<i32>, tensor<19xf32>)"
    assert str(main.type) == signature
    text = str(module)
    assert "custom_call" not in text  # of one platform's own
    assert f"attjax_policy_{flight_policy.parameter_hash(flight.params)}" in text
    states = flight_check.flown_decisions(flight, 4, 10, 20)
    actions = exported.bytecode_actions(bytecode, states)
    assert len(np.unique(actions)) > 4 and exported.differing(states, actions)[0] == 0


def test_exports_name_no_folder_of_the_machine_that_wrote_them():
    export_stablehlo = pytest.importorskip("attjax.export.stablehlo", exc_type=ImportError)
    contents = export_stablehlo.files(exported.load(PRECISE, 5))
    for content in contents.values():
        data = content if isinstance(content, bytes) else content.encode()
        assert str(ROOT).encode() not in data and b".py" not in data


def test_a_policy_without_a_clear_decision_is_refused():
    flight = exported.untrained("state", (16,), 0.0)
    same = jax.tree.map(jnp.zeros_like, flight.params)
    flight = FlightPolicy(flight.policy, same, flight.env, flight.origin)
    with pytest.raises(ValueError, match="all its decisions hang on rounding"):
        export_c.files(flight, seed=0)
