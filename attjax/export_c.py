"""A policy as C99 for flight software: a header and a source, and a test program beside them."""

import numpy as np

import attjax
from attjax import flight_policy, networks, template
from attjax.flight_policy import FlightPolicy

POLICY_FILES = ("attjax_policy.h", "attjax_policy.c")
TEST_FILES = ("attjax_vectors.h", "attjax_test.c")
FILES = POLICY_FILES + TEST_FILES
VECTORS = 500
VECTOR_SLEWS = 25
NUMBERS_A_LINE = 8


def files(flight: FlightPolicy, seed: int) -> dict[str, str]:
    """The text of each of FILES; ``seed`` draws the slews that the test vectors come from."""
    return policy_files(flight) | test_files(flight, seed)


def policy_files(flight: FlightPolicy) -> dict[str, str]:
    """The header and the source."""
    values = _header_values(flight) | _source_values(flight)
    return {name: _fill(name, values) for name in POLICY_FILES}


def test_files(flight: FlightPolicy, seed: int) -> dict[str, str]:
    """The test program, and the test vectors that it includes."""
    values = _vector_values(flight, seed)
    return {name: _fill(name, values) for name in TEST_FILES}


def constant_bytes(flight: FlightPolicy) -> int:
    """Bytes of the constants in the C source."""
    count = sum(x.weights.size + x.biases.size for x in flight.layers) + flight.torque_table.size
    mask = flight.rate_mask
    if mask is not None:
        count += mask.form.size + mask.impulse.size + mask.own_gain.size + 1
    if flight.policy.features == "multiscale":
        count += len(networks.SCALES)
    return 4 * count


def stack_bytes(flight: FlightPolicy) -> int:
    """Bytes of the arrays that a decision has on the stack at once."""
    inputs, hidden = flight.layers[0].weights.shape[0], sum(flight.policy.hidden_sizes)
    return 4 * (inputs + hidden + 2 * len(flight.torque_table))  # the last: logits, allowed


def operations(flight: FlightPolicy) -> dict[str, int]:
    """Operations of a decision: multiply_adds, tanh, comparisons (at most) and other."""
    actions = len(flight.torque_table)
    multiply_adds = sum(x.weights.size for x in flight.layers)
    comparisons = 7 + sum(flight.policy.hidden_sizes) + actions - 1
    if flight.policy.features == "multiscale":
        tanh = 6 * len(networks.SCALES)
        other = tanh + tanh // 2
    else:
        tanh, other = 0, 4 * 6
    if flight.rate_mask is not None:
        multiply_adds += 9 + 3 + 3 * actions
        other += 3 * actions
        comparisons += 2 * actions
    return {
        "multiply_adds": multiply_adds,
        "tanh": tanh,
        "comparisons": comparisons,
        "other": other,
    }


def _fill(name, values):
    """A template with these values, and the version that all of them may name."""
    return template.fill(name, version=attjax.__version__, **values)


def _header_values(flight):
    context = flight.context
    return operations(flight) | {
        "origin": _comment(flight.origin),
        "actions": len(flight.torque_table),
        "spacecraft": _comment(flight.env.spacecraft.name),
        "inertia": _inertia(flight.env.spacecraft.inertia),
        "constant_bytes": constant_bytes(flight),
        "stack_bytes": stack_bytes(flight),
        "no_torque": flight.no_torque,
        "control_period": _number(flight.env.control_period),
        "pulse": _number(context.torque_duration),
        "rate_limit": _number(context.rate_limit),
    }


def _source_values(flight):
    return {
        "features": flight.layers[0].weights.shape[0],
        "torque_table": _table(flight.torque_table),
        "weights": "\n".join(_weights(n, x) for n, x in enumerate(flight.layers, 1)),
        "features_function": _features_function(flight),
        "forward": _forward(flight.layers),
        "allow_function": _allow_function(flight),
    }


def _features_function(flight):
    if flight.policy.features == "state":
        return _fill("features_state.c", {})
    period, ten = flight.control_period, np.float32(10)
    values = {
        "scales": len(networks.SCALES),
        "scale_values": _table(np.array(networks.SCALES)),
        "feature_period": networks.FEATURE_PERIOD,
        "attitude_factor": _number(np.float32(networks.FEATURE_PERIOD) / period),
        "tenfold_period": _number(ten * period),
        "log_tenfold_period": _number(np.log(ten * period)),
    }
    return _fill("features_multiscale.c", values)


def _allow_function(flight):
    mask = flight.rate_mask
    if mask is None:
        return _fill("allow_all.c", {})
    values = {
        "form": _table(mask.form),
        "impulse": _table(mask.impulse),
        "own_gain": _table(mask.own_gain),
        "limit_squared": _table(mask.limit_squared),
        "margin": f"{flight.policy.rate_margin:g}",
    }
    return _fill("allow_rate_mask.c", values)


def _weights(number, layer):
    inputs, outputs = layer.weights.shape
    weights, biases = _table(layer.weights.ravel()), _table(layer.biases)
    return (
        f"static const float weights_{number}[{inputs} * {outputs}] = {weights};\n"
        f"static const float biases_{number}[{outputs}] = {biases};\n"
    )


def _forward(layers):
    """The body of attjax_logits: one call for each layer."""
    hidden = range(1, len(layers))
    sizes = {n: layers[n - 1].weights.shape[1] for n in hidden}
    lines = ["float features[FEATURES];"]
    lines += [f"float hidden_{n}[{sizes[n]}];" for n in hidden]
    lines += ["", "features_of(quaternion, angular_velocity, features);"]
    x = "features"
    for n, (inputs, outputs) in enumerate((x.weights.shape for x in layers), 1):
        y = f"hidden_{n}" if n in sizes else "logits"
        lines += [f"layer({inputs}, {outputs}, weights_{n}, biases_{n}, {x}, {y});"]
        lines += [f"rectify({outputs}, {y});"] if n in sizes else []
        x = y
    return "\n".join("    " + line if line else "" for line in lines)


def _vector_values(flight, seed):
    flown = flight_policy.flown_decisions(flight, seed, VECTOR_SLEWS, 4 * VECTORS // VECTOR_SLEWS)
    clear = np.flatnonzero(flown.clear)
    chosen = clear[np.linspace(0, len(clear) - 1, min(VECTORS, len(clear))).astype(int)]
    rows = [
        f"{{{_row(flown.quaternion[i])}, {_row(flown.angular_velocity[i])}, {flown.action[i]}}}"
        for i in chosen
    ]
    slews = flight_policy.fly_table_5(flight)
    inertia = np.asarray(flight.context.inertia, float)
    tensor = np.diag(inertia) if inertia.ndim == 1 else inertia
    rk4_steps = 1 + flight.env.frameskip
    torque_steps = rk4_steps if flight.env.default_params.torque_held else 1
    return {
        "tensor": _table(tensor, _double),
        "inverse": _table(np.linalg.inv(tensor), _double),
        "torque_steps": torque_steps,
        "coasting_steps": rk4_steps - torque_steps,
        "goal_deg": _double(flight.env.spacecraft.goal_angle_deg),
        "decisions": int(flight.env.default_params.max_steps_in_episode),
        "slews": len(slews.rate),
        "slew_start": _table(slews.quaternion, _double),
        "slew_error_deg": _row(slews.error_deg, _double),
        "slew_rate": _row(slews.rate, _double),
        "vectors": len(chosen),
        "vector_values": "{\n    " + ",\n    ".join(rows) + "}",
    }


def _inertia(values):
    if isinstance(values[0], tuple):
        rows = "; ".join(" ".join(f"{x:g}" for x in row) for row in values)
        return f"inertia tensor\n * ({rows})"
    return f"moments of inertia\n * ({', '.join(f'{x:g}' for x in values)})"


def _comment(text):
    """Text that may stand in a C comment."""
    return text.encode("ascii", "replace").decode().replace("*/", "* /").replace("??/", "?? /")


def _table(values, number=None):
    """A C initialiser of a vector, some numbers a line, or of a matrix, a row a line."""
    values = np.asarray(values)
    if values.ndim == 1:
        cuts = range(NUMBERS_A_LINE, values.size, NUMBERS_A_LINE)
        rows = [_row(part, number)[1:-1] for part in np.split(values, cuts)]
    else:
        rows = [_row(part, number) for part in values]
    return "{\n    " + ",\n    ".join(rows) + "}"


def _row(values, number=None):
    return "{" + ", ".join(map(number or _number, np.asarray(values))) + "}"


def _number(x):
    """A C constant that is exactly this float32."""
    return str(np.float32(x) + np.float32(0)) + "f"  # + 0: no -0.0


def _double(x):
    """A C constant that is exactly this number."""
    return repr(float(x))
