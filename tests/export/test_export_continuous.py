"""Exported policies of continuous actions give the torques of JAX, as C, ONNX and StableHLO."""

import functools
import re

import exported
import jax
import numpy as np
import pytest
from exported import needs_compiler
from exported_continuous import (
    DAMPING,
    STIFFNESS,
    WHEELS,
    c_torques,
    feedback,
    untrained,
    with_a_weight_changed,
)

from attjax.export import c as export_c

CASES = [
    feedback,
    functools.partial(untrained, "state", (24, 8)),
    functools.partial(untrained, "multiscale", (64, 64)),
    functools.partial(untrained, "multiscale", (8, 8, 8), WHEELS),
]
each = pytest.mark.parametrize("case", CASES, ids=["feedback", "state", "multiscale", "wheels"])


def assert_as_jax(states, torque):
    """Within a tolerance that is a few units in the last place of the layers' sums."""
    assert torque.shape == states.torque.shape == (2000, 3) and torque.dtype == np.float32
    assert 0 < states.tolerance < 1e-5
    np.testing.assert_allclose(torque, states.torque, rtol=0, atol=states.tolerance)


@needs_compiler
def test_quaternion_feedback_as_a_network_is_its_closed_form(tmp_path):
    exported.write(tmp_path, export_c.policy_files(feedback()))
    states = exported.random_states(feedback())
    q, w = states.quaternion.astype(float), states.angular_velocity.astype(float)
    expected = 0.5 * np.tanh(-STIFFNESS * q[:, :3] - DAMPING * w)
    np.testing.assert_allclose(states.torque, expected, atol=1e-6)
    torque = c_torques(tmp_path, states.quaternion, states.angular_velocity)
    np.testing.assert_allclose(torque, expected, atol=1e-6)
    assert np.all(np.ptp(expected, axis=0) > 0.9)


@needs_compiler
@each
def test_c_gives_the_torques_of_jax(tmp_path, case):
    exported.write(tmp_path, export_c.policy_files(case()))
    states = exported.random_states(case())
    assert_as_jax(states, c_torques(tmp_path, states.quaternion, states.angular_velocity))


@each
def test_onnx_gives_the_torques_of_jax(case):
    export_onnx = pytest.importorskip("attjax.export.onnx", exc_type=ImportError)
    runtime = pytest.importorskip("onnxruntime")
    states, model = exported.random_states(case()), export_onnx.model(case())
    assert [x.name for x in model.graph.output] == ["torque"]
    session = runtime.InferenceSession(model.SerializeToString())
    state = {"quaternion": states.quaternion, "angular_velocity": states.angular_velocity}
    (torque,) = session.run(None, state)
    assert_as_jax(states, torque)


@each
def test_stablehlo_gives_the_torques_of_jax(case):
    export_stablehlo = pytest.importorskip("attjax.export.stablehlo", exc_type=ImportError)
    states, contents = exported.random_states(case()), export_stablehlo.files(case())
    call = jax.export.deserialize(bytearray(contents["attjax_policy.jax"])).call
    run = jax.jit(lambda *state: jax.lax.map(lambda x: call(*x), state))
    assert_as_jax(states, np.asarray(run(states.quaternion, states.angular_velocity)))
    main = exported.stablehlo_main(contents["attjax_policy.stablehlo"])[1]
    assert str(main.type) == "(tensor<4xf32>, tensor<3xf32>) -> tensor<3xf32>"
    assert "torque:      float32 (3,)" in contents["attjax_policy.txt"]
    assert "logits" not in contents["attjax_policy.txt"]


@needs_compiler
@pytest.mark.parametrize("language", ["c", "c++"])
def test_the_test_program_passes_and_flies_table_5_as_jax(tmp_path, language):
    if exported.compiler(language) is None:
        pytest.skip("no compiler")
    exported.write(tmp_path, export_c.files(feedback(), seed=0))
    printed = exported.run_test_program(tmp_path, language=language)
    assert "500 of 500 decisions" in printed and "14 of 14 lead to no torque" in printed
    assert printed.endswith("passed\n")
    errors = re.findall(r"at the end ([\d.]+) deg, in attjax ([\d.]+)", printed)
    assert len(errors) == 3
    for in_c, in_jax in np.array(errors, float):
        assert in_c == pytest.approx(in_jax, abs=2e-6) and in_c < 0.25


@needs_compiler
@pytest.mark.parametrize("wrong", ["sign", "axes", "a weight"])
def test_the_test_program_notices_what_is_wrong(tmp_path, wrong):
    contents = export_c.files(feedback(), seed=0)
    source = contents["attjax_policy.c"]
    spoilt = {
        "sign": source.replace("] * tanhf(", "] * -tanhf("),
        "axes": source.replace("tanhf(outputs[i])", "tanhf(outputs[(i + 1) % 3])"),
        "a weight": export_c.policy_files(with_a_weight_changed(feedback(), 1, 0, 0))[
            "attjax_policy.c"
        ],
    }[wrong]
    assert spoilt != source
    exported.write(tmp_path, contents | {"attjax_policy.c": spoilt})
    printed = exported.run_test_program(tmp_path, status=1)
    assert printed.endswith("FAILED\n") and "500 of 500 decisions" not in printed
    assert (printed.count("FAILED: the goal") == 3) == (wrong != "a weight")


@pytest.mark.parametrize("layer", [0, 1, 2])
def test_a_weight_that_changes_is_beyond_the_tolerance(layer):
    """By 1 %, whichever is the largest of those to a neuron that counts."""
    flight = untrained("multiscale", (64, 64))
    states = exported.random_states(flight)
    weights = np.abs(flight.layers[layer].weights)
    for column in range(3):
        changed = with_a_weight_changed(flight, layer, int(np.argmax(weights[:, column])), column)
        other = exported.random_states.__wrapped__(changed)
        assert np.max(np.abs(other.torque - states.torque)) > 2 * states.tolerance
