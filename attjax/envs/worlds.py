"""A plant as a world's description has it, drawn for one episode."""

import math
from typing import Any

import chex
import jax
import jax.numpy as jnp
import numpy as np

from attjax.dynamics import numerics, vectors
from attjax.dynamics import quaternion as quaternions
from attjax.dynamics.actuators import Actuators, empty_queue
from attjax.dynamics.disturbances import (
    DIPOLE_TILT_DEG,
    EARTH_DIPOLE,
    EARTH_MU,
    EARTH_RADIUS,
    SOLAR_PRESSURE,
    Disturbances,
    EarthDipole,
    Orbit,
)
from attjax.dynamics.draws import Draws
from attjax.dynamics.sensing import Seen
from attjax.envs.inertia import drawn_inertia
from attjax.envs.keys import world_key
from attjax.envs.moving_parts import drawn_flexible, drawn_motors, drawn_wheels
from attjax.envs.parameters import EnvParams, EnvState, control_period
from attjax.envs.plant import Change, Plant
from attjax.envs.sensors import drawn_sensing
from attjax.envs.torques import torque_axes
from attjax.world import World


def placed(env: Any, key: chex.PRNGKey, state: EnvState, params: EnvParams) -> EnvState:
    """A state at an episode's start in the environment's world: with a plant, unless it is ideal.

    Args:
        env: an :class:`attjax.AttitudeEnv`.
        key: of the episode's reset.
        state, params: at its start.
    """
    if env.world.is_ideal:
        return state
    axes = torque_axes(params, env.spacecraft, env.actions)
    key = world_key(key)
    return state.replace(plant=drawn_plant(env.world, key, params, state, axes, env.frameskip))


def drawn_plant(
    world: World,
    key: chex.PRNGKey,
    params: EnvParams,
    state: EnvState,
    axes: chex.Array,
    frameskip: int,
) -> Plant:
    """The plant of an episode.

    Args:
        world: its description.
        key: of what is drawn.
        params: what is believed of the spacecraft.
        state: at the episode's start.
        axes: (axes, 3) unit vectors of the torque axes, body frame, as believed.
        frameskip: RK4 steps after the first in an agent step, where all spacecraft have the same.
    """
    draws = Draws(key, params.inertia.dtype)
    start = Seen(state.quaternion, state.angular_velocity)
    inertia = drawn_inertia(world.uncertainty, draws, params.inertia)
    orbit = _orbit(world, draws)
    most_delay = 0 if world.actuators is None else math.ceil(world.actuators.most_delay)
    least_steps = 1 + (frameskip if params.frameskip is None else 0)
    gains, directions = _axes(world, draws, axes)
    wheels, wheel_speeds = drawn_wheels(world.wheels, draws, directions)
    flexible, deflection = drawn_flexible(world.flexible, draws)
    size = 3 if wheels is None else len(axes)
    return Plant(
        key=jax.random.key_data(draws.key),
        inertia=inertia,
        actuators=_actuators(world, draws, gains, directions),
        queue=empty_queue(most_delay, least_steps, params.torque_held, draws.dtype, size),
        orbit=None if orbit is None else orbit[0],
        disturbances=_disturbances(world, draws, inertia, orbit),
        own_disturbances=tuple(x.drawn(draws) for x in world.own_disturbances),
        own_actuators=tuple(x.drawn(draws) for x in world.own_actuators),
        own_sensors=tuple(x.drawn(draws) for x in world.own_sensors),
        sensing=drawn_sensing(world.sensors, draws, start, control_period(params, frameskip)),
        wheels=wheels,
        wheel_speeds=wheel_speeds,
        flexible=flexible,
        deflection=deflection,
        change=_change(world.uncertainty, draws),
    )


def _change(given, draws):
    if given is None or given.change_factor == 1:
        return None
    names = "change_factor", "change_time"
    return Change(*(draws.number(name, getattr(given, name)) for name in names))


def _orbit(world, draws):
    """The orbit, its radius, m, and unit vectors of node, flight and normal: columns; or None.

    The target's frame is turned at random towards that of the orbit.
    """
    if world.orbit is None:
        return None
    frame = quaternions.rotation_matrix(draws.attitude("orbit.attitude"))
    radius = EARTH_RADIUS + 1e3 * draws.number("orbit.altitude_km", world.orbit.altitude_km)
    rate = jnp.sqrt(EARTH_MU / radius) / radius
    start = draws.angle("orbit.argument_of_latitude")
    return Orbit(tuple(frame[:, 0]), tuple(frame[:, 1]), rate, start), radius, frame


def _disturbances(world, draws, inertia, orbit):
    given = world.disturbances
    if given is None:
        return Disturbances()
    moments_or_rows = vectors.components(inertia)
    return Disturbances(
        gravity_gradient=moments_or_rows if given.gravity_gradient else None,
        dipole=_dipole(world, draws, orbit) if given.residual_dipole != 0 else None,
        drag=None if given.drag is None else _drag(given.drag, draws, orbit),
        radiation=given.radiation_pressure and _radiation(given.radiation_pressure, draws),
        constant=_constant(given, draws) if given.constant_torque != 0 else None,
        swinging=given.sinusoid and _swinging(given.sinusoid, draws),
    )


def _dipole(world, draws, orbit):
    _, radius, axes = orbit
    inclination = jnp.deg2rad(draws.number("orbit.inclination_deg", world.orbit.inclination_deg))
    node, ahead, normal = axes.T
    pole = jnp.cos(inclination) * normal + jnp.sin(inclination) * ahead
    tilt = math.radians(DIPOLE_TILT_DEG)
    moment = draws.number("residual_dipole", world.disturbances.residual_dipole)
    earth = EarthDipole(  # whose dipole points to its south
        strength=EARTH_DIPOLE * (EARTH_RADIUS / radius) ** 3,
        pole=tuple(-math.cos(tilt) * pole),
        first=tuple(-math.sin(tilt) * node),
        second=tuple(-math.sin(tilt) * jnp.cross(pole, node)),
        start=draws.angle("earth.turn"),
    )
    return tuple(moment * draws.direction("residual_dipole")), earth


def _drag(drag, draws, orbit):
    area, coefficient, density, arm = (
        draws.number(f"drag.{x}", getattr(drag, x))
        for x in ("area", "coefficient", "density", "lever_arm")
    )
    speed = orbit[0].rate * orbit[1]
    force = density * speed**2 * coefficient * area / 2
    return tuple(force * arm * draws.direction("drag.lever_arm"))


def _radiation(pressure, draws):
    area, coefficient, arm = (
        draws.number(f"radiation_pressure.{x}", getattr(pressure, x))
        for x in ("area", "coefficient", "lever_arm")
    )
    force = SOLAR_PRESSURE * coefficient * area
    lever = tuple(force * arm * draws.direction("radiation_pressure.lever_arm"))
    return lever, tuple(draws.direction("radiation_pressure.sun"))


def _constant(given, draws):
    axis = draws.direction("constant_axis")
    if given.constant_axis is not None:
        axis = numerics.unit(jnp.array(given.constant_axis, axis.dtype))
    return tuple(draws.number("constant_torque", given.constant_torque) * axis)


def _swinging(sinusoid, draws):
    amplitude = draws.number("sinusoid.torque", sinusoid.torque) * draws.direction("sinusoid.axis")
    rate = 2 * math.pi / draws.number("sinusoid.period", sinusoid.period)
    return tuple(amplitude), rate, draws.angle("sinusoid.phase")


def _axes(world, draws, axes):
    """Gains (axes, 1) and directions (axes, 3) of the torque axes; None where they are ideal."""
    given = world.actuators
    if given is None:
        return None, None
    count = len(axes)
    directions = jnp.asarray(axes, draws.dtype)
    if given.misalignment_deg != 0:
        angles = jnp.deg2rad(draws.number("misalignment_deg", given.misalignment_deg, (count,)))
        turned = [
            draws.tilted(f"misalignment_deg.{n}", directions[n], angles[n]) for n in range(count)
        ]
        directions = jnp.stack(turned)
    return draws.number("gain", given.gain, (count, 1)), directions


def _actuators(world, draws, gains, directions):
    given = world.actuators
    if given is None:
        return None
    faults = None
    if given.faulty_axes:
        is_faulty = np.isin(np.arange(1, len(directions) + 1), given.faulty_axes)
        faults = jnp.where(is_faulty, draws.number("fault_gain", given.fault_gain), 1)
    has_faults = given.dead_levels or given.faulty_axes
    has_delay = given.delay != 0
    return Actuators(
        directions=gains * directions,
        faults=faults,
        fault_time=draws.number("fault_time", given.fault_time) if has_faults else None,
        delay=jnp.round(draws.number("delay", given.delay)) if has_delay else None,
        jitter=given.delay_jitter,
        dead_levels=tuple(level - 1 for level in given.dead_levels),
        minimum_impulse=given.minimum_impulse,
        granularity=given.on_time_granularity,
        motors=drawn_motors(given.wheels, draws, gains[:, 0]),
    )
