"""Deliberate faults of the run-time assurance, for faults.py: bounds that are none."""

BOUNDS = ["tests/control/test_plants.py"]
STOPPING = ["tests/control/test_stopping.py"]
CLOSED = ["tests/control/test_assured.py"]
CONES = ["tests/control/test_keep_out.py"]
STATED = ["tests/envs/test_bounds.py"]
ADAPTING = ["tests/control/test_assured_adaptation.py"]
IN_C = ["tests/export/test_export_assured.py"]
ASSURANCE_FAULTS = {
    "the least of what lowers P taken for the most": (
        "attjax/control/plants.py", "straight += jnp.maximum(", "straight += jnp.minimum(", BOUNDS,
    ),
    "axes that are off, in one of the two places": (
        "attjax/control/plants.py", "off = off + self.turned * worked * speed",
        "off = off + 0 * self.turned * worked * speed", BOUNDS,
    ),
    "a rate that is told exactly": (
        "attjax/control/plants.py", "+ 2 * error * self.sensitivity", "+ 0 * error", BOUNDS,
    ),
    "a body that does not turn while the torque lasts": (
        "attjax/control/plants.py", "squared = self.most_growth**2 + turning",
        "squared = self.most_growth**2 + 0 * turning", BOUNDS,
    ),
    "wheels' momentum that turns nothing": (
        "attjax/control/plants.py", "+ self.feeding * most**2", "+ 0 * self.feeding", BOUNDS,
    ),
    "a middle moment at an end only": (
        "attjax/control/plants.py", "_form(jnp.clip((x + y) / 2, low, high), x, y)",
        "_form(low, x, y)", BOUNDS,
    ),
    "nothing between the directions": (
        "attjax/control/stopping.py", "2**0.5 / CELLS * _steepest(plants)",
        "0 * _steepest(plants)", STOPPING,
    ),
    "a stopping angle without its first period": (
        "attjax/control/stopping.py", "angles = period * (edges + jnp.append(",
        "angles = period * (0 * edges + jnp.append(", STOPPING,
    ),
    "any action in place of the braking one": (
        "attjax/control/assured.py", "jnp.arange(len(change)) == jnp.argmin(change)",
        "jnp.arange(len(change)) == jnp.argmax(change)", CLOSED,
    ),
    "a cone seen from the wrong frame": (
        "attjax/control/keep_out.py", "matmul(self.directions, turn)",
        "matmul(self.directions, turn.T)", CONES,
    ),
    "a gain's deviation for its bound": (
        "attjax/envs/torque_bounds.py", "return _end(number, largest(number), DEVIATIONS)",
        "return number if isinstance(number, float | int) else number.moments[0]", STATED,
    ),
    "a change in mid-flight that has no bound": (
        "attjax/envs/torque_bounds.py", "math.prod(map(high, given)) * max(1, high(change))",
        "math.prod(map(high, given))", STATED,
    ),
    "a rate that is leaned for the one that is": (
        "attjax/control/flight_loop.py", "chosen(observation, self.scores(shown, known))",
        "chosen(shown, self.scores(shown, known))", ADAPTING,
    ),
    "a delay looked across by what was identified": (
        "attjax/control/flight_loop.py", "adaptation.given(queue, context), context)",
        "memory.bodily(known), context)", ADAPTING,
    ),
    "a filter's mean where the truth is told": (
        "attjax/control/estimator.py",
        "return _as_told(estimate, told) if context.knowledge.is_told else estimate",
        "return estimate", ADAPTING,
    ),
    "a torque that is estimated, across a delay": (
        "attjax/control/flight_loop.py", "estimate = estimate.replace(torque=None)", "pass",
        ADAPTING,
    ),
    "what was believed before the flight for the controller": (
        "attjax/control/flight_loop.py", "known, shown = self.believed(memory, context)",
        "known, shown = context", ADAPTING,
    ),
    "what an error of the rate adds left out in C": (
        "attjax/export/assured.py", '"of_rate_error": 2 * assurance.error',
        '"of_rate_error": 0 * assurance.error', IN_C,
    ),
    "the square of an action's own change left out in C": (
        "attjax/export/templates/discrete/admit.c", "2.0f * work + growth[a] * growth[a]",
        "2.0f * work", IN_C,
    ),
    "an action that brakes and is not let through in C": (
        "attjax/export/templates/discrete/admit.c", "    admitted[braking] = 1;\n", "", IN_C,
    ),
    "cones seen from the other side in C": (
        "attjax/export/templates/discrete/cones.c", "- q[3] * d[i]", "+ q[3] * d[i]", IN_C,
    ),
    "actions that are not let through, chosen in C": (
        "attjax/export/assured.py", "    keep_admitted(quaternion, angular_velocity, allowed);\\n",
        "    (void)keep_admitted;\\n", IN_C,
    ),
    "scores in the policy's own order": (
        "attjax/ppo/networks.py", "lowest.at[torque_order.rows(context)].max(logits)",
        "lowest.at[: len(logits)].max(logits)", ["tests/control/test_own_units.py"],
    ),
}  # fmt: skip
"""As faults.FAULTS."""
