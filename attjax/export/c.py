"""A policy as C99 for flight software: a header and a source, and a test program beside them."""

from string import Template

import numpy as np

from attjax import resources
from attjax.export import c_names, c_text, flight_check
from attjax.export.flight_policy import FlightPolicy
from attjax.export.inputs import FORMS, CInputs

TEMPLATES = "export/templates"
POLICY_FILES = ("attjax_policy.h", "attjax_policy.c")
TEST_FILES = ("attjax_vectors.h", "attjax_test.c")
FILES = POLICY_FILES + TEST_FILES
VECTORS = 500
VECTOR_SLEWS = 25
INDENT = " " * 15
"""Of the lines after the first that tell a fact."""


def files(flight: FlightPolicy, seed: int, prefix: str = c_names.PREFIX) -> dict[str, str]:
    """The text of each of FILES, by its name with the prefix.

    Args:
        flight: the policy.
        seed: draws the slews that the test vectors come from.
        prefix: of all names: files, symbols, macros.

    Raises:
        ValueError: the prefix is none, or the policy decides nothing clearly.
    """
    return policy_files(flight, prefix) | test_files(flight, seed, prefix)


def policy_files(flight: FlightPolicy, prefix: str = c_names.PREFIX) -> dict[str, str]:
    """The header and the source."""
    decision = flight.kind.c(flight)
    values = _values(flight, decision, prefix) | _source_values(flight, decision, prefix)
    return _filled(POLICY_FILES, prefix, decision.parts, values)


def test_files(flight: FlightPolicy, seed: int, prefix: str = c_names.PREFIX) -> dict[str, str]:
    """The test program, and the test vectors that it includes."""
    decision = flight.kind.c(flight)
    values = _values(flight, decision, prefix) | _vector_values(flight, seed)
    return _filled(TEST_FILES, prefix, decision.test_parts, values)


def _filled(names, prefix, parts, values):
    c_names.check(prefix)
    values = {**values}
    for name, file in parts.items():
        values[name] = _fill(file, prefix, values)
    return {c_names.renamed(name, prefix): _fill(name, prefix, values) for name in names}


def constant_bytes(flight: FlightPolicy) -> int:
    """Bytes of the constants in the C source."""
    count = sum(x.weights.size + x.biases.size for x in flight.layers)
    return 4 * (count + _inputs(flight).constants + flight.kind.c(flight).constants)


def stack_bytes(flight: FlightPolicy) -> int:
    """Bytes of the arrays that a decision has on the stack at once."""
    inputs, hidden = flight.layers[0].weights.shape[0], sum(flight.policy.hidden_sizes)
    return 4 * (inputs + hidden + 3 * _inputs(flight).turns + flight.kind.c(flight).stack)


def operations(flight: FlightPolicy) -> dict[str, int]:
    """Operations of a decision: multiply_adds, tanh, comparisons (at most) and other."""
    inputs, decision = _inputs(flight), flight.kind.c(flight)
    return {
        "multiply_adds": sum(x.weights.size for x in flight.layers) + decision.multiply_adds,
        "tanh": inputs.tanh + decision.tanh,
        "comparisons": 7 + sum(flight.policy.hidden_sizes) + decision.comparisons,
        "other": inputs.other + decision.other,
    }


def _values(flight, decision, prefix):
    """What a file says of itself in its first comment, and what its kind of action says."""
    lines = [f" *   {k + ':':<13}{c_text.comment(v, INDENT)}" for k, v in flight.facts.items()]
    names = {name: c_names.renamed(text, prefix) for name, text in decision.names.items()}
    return {"facts": "\n".join(lines), **names, **decision.values}


def _source_values(flight, decision, prefix):
    inputs, context = _inputs(flight), flight.context
    return operations(flight) | {
        "state": _fill("state.h", prefix, {}).rstrip("\n"),
        "inertia": c_text.comment(_inertia(flight.env.spacecraft.inertia), INDENT),
        "kept_rate": c_text.comment(decision.kept_rate, INDENT),
        "constant_bytes": constant_bytes(flight),
        "stack_bytes": stack_bytes(flight),
        "control_period": c_text.number(flight.env.control_period),
        "pulse": c_text.number(context.torque_duration),
        "rate_limit": c_text.number(context.rate_limit),
        "features": flight.layers[0].weights.shape[0],
        "weights": "\n".join(_weights(n, x) for n, x in enumerate(flight.layers, 1)),
        "features_function": _fill(inputs.template, prefix, inputs.values),
        "forward": _forward(flight.layers, decision.values["outputs"], inputs.turns),
    }


def _inputs(flight: FlightPolicy) -> CInputs:
    return FORMS[flight.policy.features].c(flight.context)


def _weights(number, layer):
    inputs, outputs = layer.weights.shape
    weights, biases = c_text.table(layer.weights.ravel()), c_text.table(layer.biases)
    return (
        f"static const float weights_{number}[{inputs} * {outputs}] = {weights};\n"
        f"static const float biases_{number}[{outputs}] = {biases};\n"
    )


def _forward(layers, outputs, turns):
    """The body of the function that fills in the outputs: one call for each layer."""
    hidden = range(1, len(layers))
    sizes = {n: layers[n - 1].weights.shape[1] for n in hidden}
    lines = ["float features[FEATURES];"]
    lines += [f"float hidden_{n}[{sizes[n]}];" for n in hidden]
    lines += ["int backward[3];"] if turns else []
    arguments = "quaternion, angular_velocity, features" + (", backward" if turns else "")
    lines += ["", f"features_of({arguments});"]
    x = "features"
    for n, (rows, columns) in enumerate((x.weights.shape for x in layers), 1):
        y = f"hidden_{n}" if n in sizes else outputs
        lines += [f"layer({rows}, {columns}, weights_{n}, biases_{n}, {x}, {y});"]
        lines += [f"rectify({columns}, {y});"] if n in sizes else []
        x = y
    lines += [f"turn_back(backward, {outputs});"] if turns else []
    return "\n".join("    " + line if line else "" for line in lines)


def _vector_values(flight, seed):
    flown = flight_check.flown_decisions(flight, seed, VECTOR_SLEWS, 4 * VECTORS // VECTOR_SLEWS)
    usable = np.flatnonzero(flown.comparable)
    if not len(usable):
        raise ValueError("all its decisions hang on rounding")
    chosen = usable[np.linspace(0, len(usable) - 1, min(VECTORS, len(usable))).astype(int)]
    states = [map(c_text.row, (flown.quaternion[i], flown.angular_velocity[i])) for i in chosen]
    rows = [f"{{{', '.join(x)}, {flown.c_decision(i)}}}" for i, x in zip(chosen, states)]
    slews = flight_check.fly_table_5(flight)
    inertia = np.asarray(flight.context.inertia, float)
    tensor = np.diag(inertia) if inertia.ndim == 1 else inertia
    rk4_steps = 1 + flight.env.frameskip
    torque_steps = rk4_steps if flight.env.default_params.torque_held else 1
    return {
        **flown.c_values,
        "tensor": c_text.table(tensor, c_text.double),
        "inverse": c_text.table(np.linalg.inv(tensor), c_text.double),
        "torque_steps": torque_steps,
        "coasting_steps": rk4_steps - torque_steps,
        "goal_deg": c_text.double(flight.env.spacecraft.goal_angle_deg),
        "decisions": int(flight.env.default_params.max_steps_in_episode),
        "slews": len(slews.rate),
        "slew_start": c_text.table(slews.quaternion, c_text.double),
        "slew_error_deg": c_text.row(slews.error_deg, c_text.double),
        "slew_rate": c_text.row(slews.rate, c_text.double),
        "vectors": len(chosen),
        "vector_values": "{\n    " + ",\n    ".join(rows) + "}",
    }


def _inertia(values):
    if isinstance(values[0], tuple):
        tensor = "; ".join(map(_numbers, values))
        return f"tensor ({tensor}) kg m^2, in the axes of the body frame"
    return f"moments ({_numbers(values)}) kg m^2, about the axes of the body frame"


def _numbers(values):
    return ", ".join(repr(float(x)) for x in values)


def _fill(name, prefix, values):
    """A template with these values; the template's own names, no user's, get the prefix."""
    text = c_names.renamed(resources.read(f"{TEMPLATES}/{name}"), prefix)
    return Template(text).substitute(values)
