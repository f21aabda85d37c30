"""Deliberate faults of imperfect worlds, for faults.py: sign, unit, frame and time of effects."""

DISTURBANCES = ["tests/envs/test_disturbances.py"]
WORLDS = ["tests/envs/test_worlds.py"]
SENSORS = ["tests/envs/test_sensors.py"]
WORLD_FAULTS = {
    "gravity gradient of the other sign": (
        "attjax/dynamics/disturbances.py", "vectors.cross(up, vectors.times(self.gravity[1], up))",
        "vectors.cross(vectors.times(self.gravity[1], up), up)", DISTURBANCES,
    ),
    "gravity gradient without its factor 3": (
        "attjax/dynamics/disturbances.py", "3**0.5 * orbit.rate", "orbit.rate", DISTURBANCES,
    ),
    "disturbances in the target's frame instead of the body's": (
        "attjax/dynamics/disturbances.py", "attitude = vectors.attitude_matrix(quaternion)",
        "attitude = tuple(zip(*vectors.attitude_matrix(quaternion)))", DISTURBANCES,
    ),
    "drag with the flight": (
        "attjax/dynamics/disturbances.py", "levers.append((self.drag, vectors.scaled(-1, along)))",
        "levers.append((self.drag, along))", DISTURBANCES,
    ),
    "sunlight from behind": (
        "attjax/dynamics/disturbances.py", "levers.append((lever, vectors.scaled(-1, sun)))",
        "levers.append((lever, sun))", DISTURBANCES,
    ),
    "the Earth's dipole points north": (
        "attjax/envs/worlds.py", "pole=tuple(-math.cos(tilt) * pole)",
        "pole=tuple(math.cos(tilt) * pole)", DISTURBANCES,
    ),
    "the Earth turns westwards": (
        "attjax/envs/worlds.py", "second=tuple(-math.sin(tilt) * jnp.cross(pole, node))",
        "second=tuple(math.sin(tilt) * jnp.cross(pole, node))", DISTURBANCES,
    ),
    "altitude taken for the radius": (
        "attjax/envs/worlds.py", "radius = EARTH_RADIUS + 1e3", "radius = 1e3", DISTURBANCES,
    ),
    "a pulse one RK4 step late": (
        "attjax/dynamics/forced_motion.py", "_chosen(pulse.start == number,",
        "_chosen(pulse.start + 1 == number,", WORLDS,
    ),
    "a held torque that ends with its period": (
        "attjax/dynamics/actuators.py", "count = most_delay // rk4_steps + (2 if held else 1)",
        "count = most_delay // rk4_steps + 1", WORLDS,
    ),
    "a star tracker that looks along another axis": (
        "attjax/dynamics/sensors.py", "(self.about - self.across) * along * axis",
        "(self.about - self.across) * along * axis[::-1]", SENSORS,
    ),
    "noise of the gyro for any sampling time": (
        "attjax/envs/sensors.py", "walk / jnp.sqrt(interval)", "walk", SENSORS,
    ),
    "latency left out": (
        "attjax/dynamics/clock.py", "jnp.where(newest + self.latency <= end, newest, of_before)",
        "newest", SENSORS,
    ),
    "a bias that only grows": (
        "attjax/dynamics/sensors.py", "kept * self.wandered + fresh", "self.wandered + fresh",
        SENSORS,
    ),
    "a sample of the agent step's end": (
        "attjax/dynamics/forced_motion.py", "_chosen(number + 1 == sample, now, before)", "now",
        SENSORS,
    ),
    "the inertia that is believed flies": (
        "attjax/envs/worlds.py",
        "inertia = drawn_inertia(world.uncertainty, draws, params.inertia)",
        "inertia = params.inertia", WORLDS,
    ),
}  # fmt: skip
"""As faults.FAULTS."""
