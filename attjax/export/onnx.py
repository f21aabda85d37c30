"""A policy as an ONNX graph. Needs the extra ``onnx``.

Inputs, float32: ``quaternion`` (batch, 4), unit error quaternions, scalar last, and
``angular_velocity`` (batch, 3), body frame, rad/s. Outputs: ``action`` (batch,), int64, and
``logits`` (batch, actions), -1e9 where masked; or of continuous actions ``torque`` (batch, 3), body
frame, N m. Numbers that are not finite are not looked for.
Where the policy comes from and what it was trained for is in the model's metadata.
"""

from typing import Any

import numpy as np
import onnx
from numpy.typing import ArrayLike
from onnx import helper, numpy_helper

import attjax
from attjax.export import c_names
from attjax.export.flight_policy import FlightPolicy
from attjax.export.inputs import FORMS

FILES = ("attjax_policy.onnx",)
OPSET = 17
IR_VERSION = 8
"""What ONNX Runtime reads since its version 1.13, of 2022."""


class Graph:
    """Nodes and constants, in the order in which they are added."""

    def __init__(self):
        self.nodes, self.constants, self.results = [], [], []

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

    def result(self, name: str, kind: type[np.number], *sizes: int) -> None:
        """Tell that a node's output of shape (batch, sizes...) is one of the graph's."""
        self.results.append(_tensor(name, *sizes, kind=kind))


def files(flight: FlightPolicy, seed: int = 0, prefix: str = c_names.PREFIX) -> dict[str, bytes]:
    """The content of each of FILES, by its name with the prefix; no test vectors need a seed."""
    del seed
    name = c_names.renamed(FILES[0], c_names.check(prefix))
    return {name: model(flight).SerializeToString(deterministic=True)}


def model(flight: FlightPolicy) -> onnx.ModelProto:
    """The policy as an ONNX model, checked."""
    graph = Graph()
    form = FORMS[flight.policy.features]
    outputs = _network(graph, flight.layers, form.onnx(graph, flight.context))
    flight.kind.onnx(graph, flight, form.onnx_outputs(graph, outputs))
    inputs = [_tensor("quaternion", 4), _tensor("angular_velocity", 3)]
    result = helper.make_model(
        helper.make_graph(
            graph.nodes,
            "attjax_policy",
            inputs,
            graph.results,
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


def _tensor(name, *sizes, kind=np.float32):
    number = helper.np_dtype_to_tensor_dtype(np.dtype(kind))
    return helper.make_tensor_value_info(name, number, ["batch", *sizes])


def _network(graph, layers, x):
    for number, layer in enumerate(layers, 1):
        weights = graph.constant(f"weights_{number}", layer.weights)
        biases = graph.constant(f"biases_{number}", layer.biases)
        x = graph.add("Gemm", [x, weights, biases], f"layer_{number}")
        if number < len(layers):
            x = graph.add("Relu", [x], f"hidden_{number}")
    return x
