"""Exports of continuous actions: what they refuse, say and leave out, and a run from the shell."""

import itertools
import re
import subprocess

import exported
import jax
import numpy as np
import pytest
from commands import TINY, export_script, train_script
from exported import needs_compiler
from exported_continuous import c_torques, feedback, flying, untrained

from attjax import AttitudeEnv
from attjax.envs.parameters import EnvState
from attjax.export import c as export_c
from attjax.export import flight_check, flight_policy
from attjax.export.flight_policy import FlightPolicy
from attjax.ppo.networks import Policy
from attjax.runs import checkpoint

BOTH = """
#include "choose_policy.h"
#include "steer_policy.h"

int main(void)
{
    const float q[4] = {0.6f, 0.0f, 0.0f, 0.8f}, w[3] = {0.0f, 0.0f, 0.0f};
    float torque[3];

    steer_torque(q, w, torque);
    return !(torque[0] < 0.0f && choose_decide(q, w) < CHOOSE_ACTIONS &&
             STEER_CONTROL_PERIOD < CHOOSE_CONTROL_PERIOD);
}
"""


@needs_compiler
def test_no_torque_follows_what_is_not_finite(tmp_path):
    exported.write(tmp_path, export_c.policy_files(feedback()))
    good = np.array([0.1, 0.2, 0.3, 0.9, 0.1, 0.1, 0.1], np.float32)
    bad = np.nan, np.inf, -np.inf
    spoilt = [np.where(np.arange(7) == i, x, good) for i in range(7) for x in bad]
    states = np.array([good, *spoilt], np.float32)
    torque = c_torques(tmp_path, states[:, :4].copy(), states[:, 4:].copy())
    assert np.all(torque[0] != 0)
    assert len(torque) == 22 and not np.any(torque[1:])


@needs_compiler
def test_no_torque_follows_what_the_network_cannot_hold(tmp_path):
    """Two neurons beyond float32, of which the torque is the difference: NaN in JAX."""
    inputs = np.eye(11, 2) + np.eye(11, 2)[:, ::-1]
    flight = flying(
        Policy(hidden_sizes=(2,), actions="continuous"),
        [(2 * inputs, [0, 0]), (np.outer([1, -1], np.ones(6)), np.ones(6))],
    )
    exported.write(tmp_path, export_c.policy_files(flight))
    quaternion = np.float32([[0.1, 0, 0, 0], [3e38, 0, 0, 0]])
    rate = np.zeros((2, 3), np.float32)
    in_jax = flight_check.decisions(flight, quaternion, rate).torque
    torque = c_torques(tmp_path, quaternion, rate)
    np.testing.assert_allclose(torque[0], in_jax[0], atol=1e-6)
    assert np.all(torque[0] > 0.3) and np.all(np.isnan(in_jax[1])) and not np.any(torque[1])


@needs_compiler
@pytest.mark.parametrize("case", [("state", (24, 8)), ("multiscale", (8, 8, 8))])
def test_sizes_are_as_the_comment_says(tmp_path, case):
    """All the constants of the C source, added up by the compiler; no outputs for log_std."""
    flight = untrained(*case)
    contents = export_c.policy_files(flight)
    arrays = re.findall(r"^static const float (\w+)\[", contents["attjax_policy.c"], re.M)
    total = " + ".join(f"sizeof({name})" for name in arrays)
    check = f"\ntypedef char as_said[({total}) == {export_c.constant_bytes(flight)} ? 1 : -1];\n"
    contents["attjax_policy.c"] += check
    exported.compile_c(exported.write(tmp_path, contents), "-c", "attjax_policy.c")
    assert f"{export_c.constant_bytes(flight)} bytes" in contents["attjax_policy.h"]
    assert f"layer(8, 3, weights_{len(case[1]) + 1}" in contents["attjax_policy.c"]
    inputs = 11 if case[0] == "state" else 57
    sizes = [inputs, *case[1], 3]
    assert export_c.stack_bytes(flight) == 4 * sum(sizes)
    products = sum(a * b for a, b in itertools.pairwise(sizes))
    operations = export_c.operations(flight)
    assert operations["multiply_adds"] == products
    assert operations["tanh"] == 3 + (54 if inputs == 57 else 0)


def test_the_hash_is_that_of_the_whole_network():
    """Of log_std too, of which no other number of the files depends."""
    flight = feedback()
    params = jax.tree.map(np.array, flight.params)
    params["policy"]["params"]["Dense_1"]["bias"][3:] += 1
    other = FlightPolicy(flight.policy, params, flight.env, flight.origin)
    before, after = (flight_policy.parameter_hash(x.params) for x in (flight, other))
    assert before != after
    files, expected = export_c.files(other, seed=0), export_c.files(flight, seed=0)
    assert {name: x.replace(after, before) for name, x in files.items()} == expected
    assert all(after in text for text in files.values())


@needs_compiler
def test_it_links_with_a_discrete_policy_under_any_prefix(tmp_path):
    choosing = exported.untrained("state", (16,), 0.99)
    contents = export_c.files(choosing, 0, "choose") | export_c.files(feedback(), 0, "steer")
    files = ("policy.c", "policy.h", "test.c", "vectors.h")
    assert set(contents) == {f"{x}_{y}" for x in ("choose", "steer") for y in files}
    for text in contents.values():
        assert "attjax_" not in text.lower()
    exported.write(tmp_path, contents | {"both.c": BOTH})
    sources = "both.c", "choose_policy.c", "steer_policy.c"
    exported.compile_c(tmp_path, *sources, "-o", "both")
    assert subprocess.run([tmp_path / "both"]).returncode == 0


def test_a_simulator_of_other_actions_is_refused():
    flight = feedback()
    with pytest.raises(ValueError, match="the simulator has discrete actions, the policy contin"):
        FlightPolicy(flight.policy, flight.params, AttitudeEnv(5), flight.origin)
    steered = AttitudeEnv(5, actions="continuous")
    flight = exported.untrained("state", (16,), 0.0)
    with pytest.raises(ValueError, match="the simulator has continuous actions, the policy discr"):
        FlightPolicy(flight.policy, flight.params, steered, flight.origin)


def test_parameters_that_are_not_finite_are_refused():
    """The log_std too, which no file has."""
    flight = feedback()
    params = jax.tree.map(np.array, flight.params)
    params["policy"]["params"]["Dense_1"]["bias"][5] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        FlightPolicy(flight.policy, params, flight.env, flight.origin)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a short run from the command line."""
    folder = tmp_path_factory.mktemp("continuous") / "ckpt"
    flags = ["--preset=paper", "--actions=continuous", "--total-steps=512", *TINY]
    assert train_script.main([*flags, "--checkpoint", str(folder)]) == 0
    return folder


@pytest.mark.parametrize("format", ["c", "onnx", "stablehlo"])
def test_a_run_exports(folder, tmp_path, format):
    pytest.importorskip({"c": "numpy", "onnx": "onnx", "stablehlo": "flatbuffers"}[format])
    flags = ["--checkpoint", folder, "--format", format, "--out", tmp_path, "--device", "cpu"]
    assert export_script.main([*map(str, flags)]) == 0
    policy, params = checkpoint.restore_network(folder)
    said = flight_policy.parameter_hash(params)
    assert any(said.encode() in path.read_bytes() for path in tmp_path.iterdir())
    if format == "c" and exported.compiler() is not None:
        printed = exported.run_test_program(tmp_path, status=1)  # it has learned nothing
        assert "500 of 500 decisions" in printed and printed.endswith("FAILED\n")
        state = np.float32([[0.6, 0, 0, 0.8]]), np.float32([[0.1, -0.2, 0.05]])
        expected = applied(policy, params, *(x[0] for x in state))
        np.testing.assert_allclose(c_torques(tmp_path, *state)[0], expected, atol=1e-6)


def applied(policy, params, quaternion, angular_velocity):
    """The torque that the environment says it applied."""
    env = AttitudeEnv(5, actions="continuous")
    state = EnvState(quaternion, angular_velocity, np.int32(0))
    observation = env.observe(jax.random.key(0), state, env.default_params)
    action = policy.act(params, observation, env.context(env.default_params))
    info = env.step_env(jax.random.key(0), state, action, env.default_params)[-1]
    assert np.any(np.abs(action) > 1e-4)
    return info["torque"]
