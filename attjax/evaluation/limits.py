"""How near flights come to their limits, by what really flies."""

import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import chex
import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from attjax import sharding
from attjax.control.keep_out import Cones, cones_of
from attjax.dynamics import rigid_body
from attjax.dynamics.numerics import matmul, squared_norm
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.keys import steps_key
from attjax.envs.torque_bounds import largest_speed
from attjax.evaluation import flown as flying
from attjax.evaluation.flown import Crew
from attjax.world.keep_out import KeepOut

TOGETHER = 512
"""Flights of a block, whose states fit the cache of a core."""


class Limits(NamedTuple):
    """That flights are to keep.

    Attributes:
        rate: ‖ω‖, rad/s.
        wheels: speed of each, rad/s; inf: there is no limit.
        cones: that are kept out of; None: there are none.
    """

    rate: chex.Numeric
    wheels: chex.Numeric
    cones: Cones | None


@struct.dataclass
class Nearness:
    """Of each flight, (flights,).

    Attributes:
        rate: the largest peak rate of the inertia that flies, of the limit; with wheels of ‖ω‖.
        wheels: the largest speed of a wheel, of its limit.
        clearance: the least angle from a cone, rad; inf: there is none.
        started: the same at the start.
        error: the largest of the estimated rate, rad/s.
    """

    rate: chex.Array
    wheels: chex.Array
    clearance: chex.Array
    started: chex.Array
    error: chex.Array


def limits(env: AttitudeEnv, keep_out: Sequence[KeepOut] = ()) -> Limits:
    """The limits of what flies.

    Args:
        env: what flies.
        keep_out: cones.
    """
    cones = cones_of(keep_out, env.context(env.default_params))
    return Limits(env.spacecraft.rate_limit, largest_speed(env.world), cones)


def nearness(
    controllers: Crew, env: AttitudeEnv, within: Limits, key: chex.PRNGKey, flights: int
) -> list[Nearness]:
    """Fly the same random slews under each of several controllers, limits passed or not.

    What is looked at after each decision says what there was between two. While nothing but the
    body's own inertia turns it, ‖ω‖ is at most the peak rate. And an axis that turns by an angle
    from one decision to the next was never farther than half of it from where it was at one.

    Args:
        controllers: flight loops first.
        env: that they fly in.
        within: limits.
        key: of the slews.
        flights: how many of each.
    """
    together = max(1, TOGETHER // len(controllers))
    blocks = -(-flights // together)
    keys = jax.random.split(key, blocks * together).reshape(blocks, together)
    flown = _fly(controllers, env, within, keys)
    each = (blocks, len(controllers), together)
    return [
        jax.tree.map(lambda x, n=n: np.asarray(x).reshape(each)[:, n].reshape(-1)[:flights], flown)
        for n in range(len(controllers))
    ]


@functools.partial(jax.jit, static_argnames="env", compiler_options=sharding.COMPILER_OPTIONS)
def _fly(crew, env, within, keys):
    return jax.lax.map(functools.partial(_fly_block, crew, env, within), keys)


def _fly_block(crew, env, within, keys):
    params, keys = env.default_params, jnp.concatenate([keys] * len(crew))
    observation, state = jax.vmap(env.reset, (0, None))(keys, params)
    keys, judge = jax.vmap(steps_key)(keys), _judge(env, within, state)
    memory = flying.first_memory(crew, flying.Flown(env, params), len(keys) // len(crew))

    def step(index, carry):
        *before, nearest = carry
        memory, results = flying.step(crew, env, params, (keys, index), before)
        now = judge(memory, before[2], results[1])
        return memory, *results[:2], _nearer(nearest, now)

    start = judge(memory, state, state)
    carry = memory, observation, state, start.replace(started=start.clearance, error=0 * start.rate)
    return jax.lax.fori_loop(0, params.max_steps_in_episode, step, carry)[-1]


def _nearer(a, b):
    return Nearness(
        rate=jnp.maximum(a.rate, b.rate),
        wheels=jnp.maximum(a.wheels, b.wheels),
        clearance=jnp.minimum(a.clearance, b.clearance),
        started=a.started,
        error=jnp.maximum(a.error, b.error),
    )


def _judge(env, within, start):
    """The nearness of (flights,) states after a control period, of memory, states before and it."""
    wheeled = start.plant is not None and start.plant.wheels is not None
    if wheeled:
        forms = jnp.eye(3)
    elif start.plant is None:
        forms = rigid_body.peak_rate_form(env.default_params.inertia)
    else:
        forms = jax.vmap(rigid_body.peak_rate_form)(start.plant.inertia)

    def peak(state):
        rate = state.angular_velocity
        product = matmul(forms, rate[..., None])[..., 0]
        return jnp.sqrt(jnp.sum(product * rate, axis=-1))

    def judge(memory: Any, before: Any, after: Any) -> Nearness:
        most = jnp.maximum(peak(before), peak(after))
        wheels = clearance = jnp.zeros_like(most)
        if wheeled:
            wheels = jnp.max(jnp.abs(after.plant.wheel_speeds), axis=-1) / within.wheels
        if within.cones is not None:
            least = jnp.min(jax.vmap(within.cones.clearance)(after.quaternion), axis=-1)
            clearance = least - within.cones.per_rate * most * env.control_period / 2
        error = jnp.zeros_like(most)
        if memory is not None:
            estimated = jnp.stack(memory.estimate.angular_velocity, axis=-1)
            error = jnp.sqrt(jax.vmap(squared_norm)(estimated - before.angular_velocity))
        none = jnp.full_like(most, jnp.inf)
        clearance = none if within.cones is None else clearance
        return Nearness(peak(after) / within.rate, wheels, clearance, clearance, error)

    return judge
