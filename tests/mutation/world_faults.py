"""Deliberate faults of imperfect worlds, for faults.py: sign, unit, frame and time of effects."""

DISTURBANCES = ["tests/envs/test_disturbances.py"]
WORLDS = ["tests/envs/test_worlds.py"]
SENSORS = ["tests/envs/test_sensors.py"]
WHEELS = ["tests/envs/test_wheels.py"]
FLEXIBLE = ["tests/envs/test_flexible.py"]
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
        "attjax/dynamics/forced_motion.py", "vectors.chosen(pulse.start == number,",
        "vectors.chosen(pulse.start + 1 == number,", WORLDS,
    ),
    "a held torque that ends with its period": (
        "attjax/dynamics/actuators.py", "count = most_delay // rk4_steps + (2 if held else 1)",
        "count = most_delay // rk4_steps + 1", WORLDS,
    ),
    "a star tracker that looks along another axis": (
        "attjax/dynamics/sensors.py", "vectors.dot((x, y, z), each)",
        "vectors.dot((z, y, x), each)", SENSORS,
    ),
    "noise of the gyro for any sampling time": (
        "attjax/envs/sensors.py", "walk / jnp.sqrt(interval)", "walk", SENSORS,
    ),
    "latency left out": (
        "attjax/dynamics/clock.py", "jnp.where(newest + self.latency <= end, newest, of_before)",
        "newest", SENSORS,
    ),
    "a bias that only grows": (
        "attjax/dynamics/sensors.py", "vectors.combined(kept, self.wandered, size, fresh)",
        "vectors.combined(1, self.wandered, size, fresh)", SENSORS,
    ),
    "a sample of the agent step's end": (
        "attjax/dynamics/forced_motion.py",
        "vectors.chosen(number + 1 == sample, now, before)", "now",
        SENSORS,
    ),
    "the inertia that is believed flies": (
        "attjax/envs/worlds.py",
        "inertia = drawn_inertia(world.uncertainty, draws, params.inertia)",
        "inertia = params.inertia", WORLDS,
    ),
    "a motor that pushes the wheel as the body": (
        "attjax/dynamics/moving_parts.py", "self._torque(-torque, speed)",
        "self._torque(torque, speed)", WHEELS,
    ),
    "friction that drives the wheel, Coulomb's": (
        "attjax/dynamics/moving_parts.py", "motor - jnp.clip(stopping,",
        "motor + jnp.clip(stopping,", WHEELS,
    ),
    "friction that drives the wheel, viscous": (
        "attjax/dynamics/moving_parts.py", "x - self.viscous * speed",
        "x + self.viscous * speed", WHEELS,
    ),
    "friction between the wheel and no body": (
        "attjax/dynamics/moving_parts.py", "vectors.scaled(-1, self.along_axes(self._all(speeds)))",
        "vectors.scaled(-1, self.along_axes(self.torques))", WHEELS,
    ),
    "Coulomb friction that reverses a wheel": (
        "attjax/dynamics/moving_parts.py",
        "stopping = self.inertia * speed / INTEGRATION_STEP + motor",
        "stopping = speed / INTEGRATION_STEP**2",
        WHEELS,
    ),
    "a saturated wheel that cannot slow down": (
        "attjax/dynamics/moving_parts.py",
        "(jnp.abs(speed) >= self.most_speed) & (motor * speed >= 0)",
        "jnp.abs(speed) >= self.most_speed",
        WHEELS,
    ),
    "a wheel that saturates in one sense only": (
        "attjax/dynamics/moving_parts.py", "(jnp.abs(speed) >= self.most_speed)",
        "(speed >= self.most_speed)", WHEELS,
    ),
    "most torque of the command before gains": (
        "attjax/dynamics/moving_parts.py", "torques = jnp.stack(self.gains) * amounts",
        "torques = amounts", WHEELS,
    ),
    "a dead band as wide again": (
        "attjax/dynamics/moving_parts.py", "jnp.abs(torques) < self.dead_band",
        "jnp.abs(torques) < 2 * self.dead_band", WHEELS,
    ),
    "wheels without gyroscopic torque": (
        "attjax/dynamics/moving_parts.py", "vectors.scaled(self.inertia, self.along_axes(speeds))",
        "vectors.scaled(0, self.along_axes(speeds))", WHEELS,
    ),
    "wheels' speeds against the stars": (
        "attjax/dynamics/moving_parts.py", "inverse * torque - vectors.dot(axis, acceleration)",
        "inverse * torque", WHEELS,
    ),
    "wheels' inertia beside the spacecraft's": (
        "attjax/dynamics/moving_parts.py", "vectors.scaled(jnp.sqrt(self.inertia), axis)",
        "vectors.scaled(0, axis)", WHEELS,
    ),
    "gyroscopic torque of the other sign": (
        "attjax/dynamics/bodies.py", "vectors.cross(momentum, angular_velocity)",
        "vectors.cross(angular_velocity, momentum)", WHEELS,
    ),
    "wheels where they are believed": (
        "attjax/envs/worlds.py", "drawn_wheels(world.wheels, draws, directions)",
        "drawn_wheels(world.wheels, draws, axes)", WHEELS,
    ),
    "wheels that rest at each agent step's start": (
        "attjax/envs/plant.py", 'zip(("wheel_speeds", "deflection"), moved)',
        'zip(("deflection",), [*moved][1:])', WHEELS,
    ),
    "revolutions a minute taken for rad/s": (
        "attjax/envs/moving_parts.py", 'draws.number("wheels.most_speed", limit)',
        'draws.number("wheels.most_speed", limit * math.pi / 30)', WHEELS,
    ),
    "a mode's momentum left out": (
        "attjax/dynamics/moving_parts.py", "vectors.scaled(state[1], self.vector)",
        "vectors.scaled(0 * state[1], self.vector)", FLEXIBLE,
    ),
    "a mode that is not driven by the body": (
        "attjax/dynamics/moving_parts.py",
        "-self._force(state) - vectors.dot(self.vector, acceleration)",
        "-self._force(state)",
        FLEXIBLE,
    ),
    "a mode that pulls the body the other way": (
        "attjax/dynamics/moving_parts.py", "vectors.scaled(self._force(state), self.vector)",
        "vectors.scaled(-self._force(state), self.vector)", FLEXIBLE,
    ),
    "hertz taken for rad/s": (
        "attjax/envs/moving_parts.py", "rate = 2 * math.pi * frequency",
        "rate = frequency", FLEXIBLE,
    ),
    "half of the damping": (
        "attjax/envs/moving_parts.py", "2 * damping * rate", "damping * rate", FLEXIBLE,
    ),
    "a mode's share of the inertia left out": (
        "attjax/dynamics/moving_parts.py", "return (self.vector,)", "return ()", FLEXIBLE,
    ),
    "a mode that is still at each agent step's start": (
        "attjax/envs/plant.py", 'zip(("wheel_speeds", "deflection"), moved)',
        'zip(("wheel_speeds",), moved)', FLEXIBLE,
    ),
}  # fmt: skip
"""As faults.FAULTS."""
