"""The network inputs that C and ONNX know: how each of attjax.control.features.FEATURES is written
down.

All numbers are those of :mod:`attjax.control.features` and :mod:`attjax.dynamics.quaternion`; here
is only how the formats spell them.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from attjax.control import features
from attjax.control.features import Multiscale, Universal
from attjax.dynamics import quaternion as quaternions
from attjax.envs.context import Context
from attjax.export import c_text
from attjax.export.c_text import Expression


class CInputs(NamedTuple):
    """Inputs in C.

    Attributes:
        template: the file that computes them.
        values: what fills it in.
        constants: how many numbers its arrays have.
        tanh, other: how many operations of a decision it takes.
    """

    template: str
    values: Mapping[str, object]
    constants: int
    tanh: int
    other: int


class Form(NamedTuple):
    """How inputs are written down for one context, a spacecraft in float32.

    Attributes:
        c: (context) to CInputs.
        onnx: (graph, context) to the name of the features among the graph's nodes.
    """

    c: Callable[[Context], CInputs]
    onnx: Callable[..., str]


def _state_in_c(context):
    """Eq. 9 by the very operations of quaternion.derivative."""
    del context
    quaternion = [Expression(f"q[{i}]") for i in range(4)]
    rate = quaternions.derivative(quaternion, [Expression(f"w[{i}]") for i in range(3)])
    lines = [f"    features[{i}] = {x.text};" for i, x in enumerate(rate, 4)]
    values = {"quaternion_rate": "\n".join(lines)}
    return CInputs("features_state.c", values, constants=0, tanh=0, other=4 * 6)


def _state_in_onnx(graph, context):
    """Eq. 11: the quaternion's rate is a sum over the products of all qᵢ and ωⱼ."""
    del context
    shapes = {"column": [0, 4, 1], "row": [0, 1, 3], "products": [0, 12]}
    shapes = {k: graph.constant(f"{k}_shape", np.array(v, np.int64)) for k, v in shapes.items()}
    column = graph.add("Reshape", ["quaternion", shapes["column"]], "column")
    row = graph.add("Reshape", ["angular_velocity", shapes["row"]], "row")
    outer = graph.add("Mul", [column, row], "outer")
    products = graph.add("Reshape", [outer, shapes["products"]], "products")
    kinematics = graph.constant("kinematics", _kinematics().reshape(12, 4))
    rate = graph.add("MatMul", [products, kinematics], "quaternion_rate")
    return graph.add("Concat", ["quaternion", rate, "angular_velocity"], "features", axis=1)


def _kinematics():
    """(4, 3, 4) factors of qᵢ ωⱼ in q̇ₖ: what quaternion.derivative makes of unit vectors."""
    rates = [[quaternions.derivative(q, w) for w in np.eye(3)] for q in np.eye(4)]
    return np.array(rates) + 0.0  # no negative zeros


def _multiscale_in_c(context):
    numbers = _multiscale(context)
    count, tanh = len(numbers.scales), numbers.factors.shape[1]
    lines = [
        f"    features[6 * SCALES + {i}] = {c_text.number(x)};"
        for i, x in enumerate(numbers.period, 1)
    ]
    values = {
        "scales": count,
        "scale_values": c_text.table(numbers.scales),
        "feature_period": features.FEATURE_PERIOD,
        "attitude_factor": c_text.number(numbers.attitude_factor),
        "period": "\n".join(lines),
    }
    return CInputs("features_multiscale.c", values, count, tanh, other=tanh + tanh // 2)


def _multiscale(context):
    return Multiscale(np.float32(context.control_period))


def _multiscale_in_onnx(graph, context):
    """Tanh of the scaled attitude and rate; q_s and the constants of the control period."""
    numbers = _multiscale(context)
    attitude = graph.constant("attitude_factors", np.eye(4, 3) * numbers.attitude_factor)
    attitude = graph.add("MatMul", ["quaternion", attitude], "attitude")
    state = graph.add("Concat", [attitude, "angular_velocity"], "state", axis=1)
    factors = graph.constant("scale_factors", numbers.factors)
    scaled = graph.add("Tanh", [graph.add("MatMul", [state, factors], "scaled")], "fine")
    constants = np.array([0, *numbers.period])
    scalar_part = np.zeros((4, len(constants)))
    scalar_part[3, 0] = 1
    scalar_part = graph.constant("scalar_part", scalar_part)
    constants = graph.constant("period", constants)
    plain = graph.add("Gemm", ["quaternion", scalar_part, constants], "plain")
    return graph.add("Concat", [scaled, plain], "features", axis=1)


def _universal_in_c(context):
    numbers = Universal.of(context)
    arrays = {name: np.ravel(x) for name, x in numbers._asdict().items()}
    arrays["scale_values"] = np.array(features.OWN_SCALES)
    arrays["slew_scale_values"] = np.array(features.SLEW_SCALES)
    values = {name: c_text.table(x) for name, x in arrays.items()}
    counts = {"scales": "scale_values", "slew_scales": "slew_scale_values"}
    counts |= {"constant_count": "constants"}
    values |= {name: str(arrays[of].size) for name, of in counts.items()}
    constants, tanh = sum(x.size for x in arrays.values()), numbers.factors.shape[1]
    products = 6 * 9 + 3 * 4  # five products of a matrix, a sum of two, and roots
    other = tanh + 6 * len(features.SLEW_SCALES) + products
    return CInputs("features_universal.c", values, constants, tanh, other)


def _universal_in_onnx(graph, context):
    """Tanh of the scaled attitude and momentum in own units; the state and the constants."""
    numbers = Universal.of(context)

    def product(name, x, matrix):
        rows = np.asarray(matrix).T
        rows = np.vstack([rows, np.zeros(3)]) if x == "quaternion" else rows
        return graph.add("MatMul", [x, graph.constant(f"{name}_rows", rows)], name)

    parts = (
        product("vector_part", "quaternion", numbers.of_vector),
        product("rate_part", "angular_velocity", numbers.of_rate),
    )
    turn, one = graph.add("Add", [*parts], "turn"), graph.constant("one", np.ones(1))
    larger = graph.add("Add", [graph.add("Abs", [turn], "size"), one], "larger")
    shortened = graph.add("Div", [turn, graph.add("Sqrt", [larger], "root")], "shortened")
    momentum = product("own_momentum", "angular_velocity", numbers.momentum)
    own = graph.add("Concat", [shortened, momentum], "own", axis=1)
    lengths = graph.constant("lengths", np.tile(np.asarray(numbers.lengths), 2))
    over_length = graph.add("Div", [own, lengths], "over_length")
    own = graph.add("Concat", [own, over_length], "both", axis=1)
    factors = graph.constant("scale_factors", numbers.factors)
    fine = graph.add("Tanh", [graph.add("MatMul", [own, factors], "scaled")], "fine")
    vector = product("vector", "quaternion", numbers.directions)
    rate = product("rate", "angular_velocity", numbers.slowness)
    nothing = graph.constant("nothing", np.zeros((4, numbers.constants.size)))
    told = graph.constant("told", np.asarray(numbers.constants))
    constants = graph.add("Gemm", ["quaternion", nothing, told], "constants")
    last = graph.constant("last", np.eye(4)[:, 3:])
    scalar = graph.add("MatMul", ["quaternion", last], "scalar")
    return graph.add("Concat", [fine, vector, scalar, rate, constants], "features", axis=1)


FORMS: dict[str | Callable, Form] = {
    "state": Form(_state_in_c, _state_in_onnx),
    "multiscale": Form(_multiscale_in_c, _multiscale_in_onnx),
    "universal": Form(_universal_in_c, _universal_in_onnx),
}
"""By name; a policy with other inputs is exported as StableHLO alone, which JAX writes."""
