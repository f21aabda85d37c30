"""Deliberate faults of the run-time assurance, for faults.py: bounds that are none."""

BOUNDS = ["tests/control/test_plants.py"]
STOPPING = ["tests/control/test_stopping.py"]
CLOSED = ["tests/control/test_assured.py"]
CONES = ["tests/control/test_keep_out.py"]
STATED = ["tests/envs/test_bounds.py"]
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
        "attjax/control/keep_out.py", "jnp.matmul(self.directions, turn,",
        "jnp.matmul(self.directions, turn.T,", CONES,
    ),
    "a gain's deviation for its bound": (
        "attjax/envs/torque_bounds.py", "return _end(number, largest(number), DEVIATIONS)",
        "return number if isinstance(number, float | int) else number.moments[0]", STATED,
    ),
}  # fmt: skip
"""As faults.FAULTS."""
