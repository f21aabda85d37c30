"""A policy as an ONNX graph. Needs the extra ``onnx``.

Inputs, float32: ``quaternion`` (batch, 4), unit error quaternions, scalar last, and
``angular_velocity`` (batch, 3), body frame, rad/s. Outputs: ``action`` (batch,), int64, and
``logits`` (batch, actions), -1e9 where masked. Numbers that are not finite are not looked for.
Where the policy comes from and what it was trained for is in the model's metadata.
"""

from typing import Any

import numpy as np
import onnx
from numpy.typing import ArrayLike
from onnx import TensorProto, helper, numpy_helper

import attjax
from attjax.export import c_names
from attjax.export.flight_policy import FlightPolicy
from attjax.export.inputs import FORMS
from attjax.ppo import networks

FILES = ("attjax_policy.onnx",)
OPSET = 17
IR_VERSION = 8
"""What ONNX Runtime reads since its version 1.13, of 2022."""


class Graph:
    """Nodes and constants, in the order in which they are added."""

    def __init__(self):
        self.nodes, self.constants = [], []

    def constant(self, name: str, values: ArrayLike) -> str:
        """Add a constant, float32 unless it is of integers or booleans; returns its name."""
        values = np.asarray(values)
        values = values.astype(np.float32) if values.dtype.kind == "f" else values
        self.constants.append(numpy_helper.from_array(values, name))
        return name

    def add(self, operator: str, inputs: list[str], output: str, **attributes: Any) -> str:
        """Add a node; returns the name of its output."""
        self.nodes.append(helper.make_node(operator, inputs, [output], output, **attributes))
        return output


def files(flight: FlightPolicy, seed: int = 0, prefix: str = c_names.PREFIX) -> dict[str, bytes]:
    """The content of each of FILES, by its name with the prefix; no test vectors need a seed."""
    del seed
    name = c_names.renamed(FILES[0], c_names.check(prefix))
    return {name: model(flight).SerializeToString(deterministic=True)}


def model(flight: FlightPolicy) -> onnx.ModelProto:
    """The policy as an ONNX model, checked."""
    graph, actions = Graph(), len(flight.torque_table)
    features = FORMS[flight.policy.features].onnx(graph, flight.control_period)
    logits = _network(graph, flight.layers, features)
    if flight.rate_mask is not None:
        masked = graph.constant("masked_logit", np.float32(networks.MASKED_LOGIT))
        logits = graph.add("Where", [_allowed(graph, flight), logits, masked], "masked_logits")
    graph.add("Identity", [logits], "logits")
    graph.add("ArgMax", [logits], "action", axis=1, keepdims=0)  # the first of equal ones
    inputs = [_tensor("quaternion", 4), _tensor("angular_velocity", 3)]
    action = helper.make_tensor_value_info("action", TensorProto.INT64, ["batch"])
    result = helper.make_model(
        helper.make_graph(
            graph.nodes,
            "attjax_policy",
            inputs,
            [action, _tensor("logits", actions)],
            graph.constants,
        ),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="attjax",
        producer_version=attjax.__version__,
        doc_string="\n".join(f"{name}: {line}" for name, line in flight.facts.items()),
    )
    helper.set_model_props(result, flight.facts)
    onnx.checker.check_model(result, full_check=True)
    return result


def _tensor(name, size):
    return helper.make_tensor_value_info(name, TensorProto.FLOAT, ["batch", size])


def _network(graph, layers, x):
    for number, layer in enumerate(layers, 1):
        weights = graph.constant(f"weights_{number}", layer.weights)
        biases = graph.constant(f"biases_{number}", layer.biases)
        x = graph.add("Gemm", [x, weights, biases], f"layer_{number}")
        if number < len(layers):
            x = graph.add("Relu", [x], f"hidden_{number}")
    return x


def _allowed(graph, flight):
    """The actions that :class:`attjax.control.assurance.RateMask` allows, (batch, actions)."""
    mask, rate = flight.rate_mask, "angular_velocity"
    form = graph.constant("peak_rate_form", mask.form)
    twice_impulse = graph.constant("twice_impulse", 2 * mask.impulse.T)
    own_gain = graph.constant("own_gain", mask.own_gain)
    limit = graph.constant("limit_squared", mask.limit_squared)
    zero = graph.constant("zero", np.float32(0))
    no_torque = graph.constant("no_torque", mask.coasts)
    gradient = graph.add("MatMul", [rate, form], "gradient")
    gain = graph.add("Gemm", [gradient, twice_impulse, own_gain], "gain")
    axis = graph.constant("axis", np.array([1], np.int64))
    terms = graph.add("Mul", [gradient, rate], "terms")
    peak = graph.add("ReduceSum", [terms, axis], "peak_squared", keepdims=1)
    after = graph.add("Add", [peak, gain], "peak_squared_after")
    within = graph.add("LessOrEqual", [after, limit], "within")
    lower = graph.add("Less", [gain, zero], "lower")
    allowed = graph.add("Or", [within, lower], "within_or_lower")
    return graph.add("Or", [allowed, no_torque], "allowed")
