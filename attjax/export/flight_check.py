"""What a policy does at states and on slews, for its exports to be checked against."""

import dataclasses

import chex
import jax
import jax.numpy as jnp
import numpy as np

from attjax import evaluation
from attjax.dynamics import quaternion as quaternions
from attjax.evaluation import paper
from attjax.export.flight_policy import FlightPolicy
from attjax.export.kind import States


def decisions(flight: FlightPolicy, quaternion: chex.Array, angular_velocity: chex.Array) -> States:
    """What the policy does at the states (states, 4) and (states, 3)."""
    single = (np.asarray(x, np.float32) for x in (quaternion, angular_velocity))
    return flight.kind.states(flight, *single)


def flown_decisions(flight: FlightPolicy, seed: int, slews: int, states_per_slew: int) -> States:
    """Decisions at states evenly spaced in time along random slews that the policy flies."""
    params = flight.env.default_params
    key = jax.random.key(seed)
    _, start = evaluation.random_slews(flight.env, params, key, slews)
    act = jax.tree_util.Partial(flight.act)
    steps = int(params.max_steps_in_episode)
    history = evaluation.record(act, flight.env, params, key, start, steps)
    chosen = np.linspace(0, steps - 1, states_per_slew).astype(int)
    states = (np.asarray(x)[chosen] for x in (history.quaternion, history.angular_velocity))
    return decisions(flight, *(x.reshape(-1, x.shape[-1]) for x in states))


@dataclasses.dataclass(frozen=True)
class Flown:
    """Slews that were flown: start (slews, 4), terminal φ and ‖ω‖ (slews,), float64.

    They are NaN where the simulation did not converge.
    """

    quaternion: np.ndarray
    error_deg: np.ndarray
    rate: np.ndarray


def fly_table_5(flight: FlightPolicy) -> Flown:
    """Fly the slews of attjax.evaluation.paper.TABLE_5, by an angle that is the spacecraft's task.

    The spacecraft is simulated in float64, with the float32 constants that the policy knows, and
    the policy is told its state in float32. That is what the C test program does, so both see
    the same states for as long as they decide alike.
    """
    act = jax.tree_util.Partial(flight.act_in_float32)
    with jax.enable_x64(True):
        params = flight.env.default_params.replace(
            inertia=jnp.asarray(flight.context.inertia, float),
            torque_table=jnp.asarray(flight.torque_table, float),
        )
        steps, start = int(params.max_steps_in_episode), _table_5(flight.env.spacecraft)
        key = jax.random.key(0)
        history = evaluation.record(act, flight.env, params, key, start, steps)
        angle = jnp.rad2deg(jax.vmap(quaternions.error_angle)(history.quaternion[-1]))
        rate = jnp.linalg.norm(history.angular_velocity[-1], axis=-1)
        return Flown(*map(np.asarray, (start.quaternion, angle, rate)))


def _table_5(craft):
    """The slews of Table 5, about the same axes by fewer or more than 100° where it must be."""
    start, (least, most) = paper.table_5_slews(), craft.slew_angles_deg
    if least <= 100 <= most:
        return start
    axes = start.quaternion[:, :3] / jnp.linalg.norm(start.quaternion[:, :3], axis=1)[:, None]
    angle = jnp.deg2rad(jnp.clip(100.0, least, most))
    turned = jax.vmap(quaternions.from_axis_angle, (0, None))(axes, angle)
    return start.replace(quaternion=turned)
