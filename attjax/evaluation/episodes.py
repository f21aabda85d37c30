"""A controller over many slews: what comes of each."""

import math
from collections.abc import Callable

import chex
import jax
import numpy as np

from attjax import errors, sharding
from attjax.envs import parameters
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.parameters import EnvParams, EnvState
from attjax.evaluation.blocks import Episodes, fly_blocks
from attjax.evaluation.flown import Controller, Crew
from attjax.values import integer

SLEWS_TOGETHER = 512
"""Most slews of a block on CPU, whose states and hidden layers of 64 fit the cache of a core."""

SLEWS_A_CALL = 2**14
"""About the most slews between two calls of a progress."""


def random_slews(
    env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey, episodes: int
) -> tuple[chex.Array, EnvState]:
    """Observations (episodes, 11) and states at the start of ``episodes`` random slews.

    Parameters in which their spacecraft differ have a leading axis (episodes,).
    """
    axes = parameters.fleet_axes(params)
    return jax.vmap(env.reset, (0, axes))(jax.random.split(key, episodes), params)


def fly(
    controller: Controller,
    env: AttitudeEnv,
    params: EnvParams,
    key: chex.PRNGKey,
    episodes: int,
    progress: Callable[[int], None] | None = None,
) -> Episodes:
    """Fly ``episodes`` random slews of ``params.max_steps_in_episode`` steps each.

    The devices share them, and what is kept of each is 37 bytes, however many there are.

    Args:
        controller: flies them; on CPU a block of them at a time, so that what a network makes of
            it stays in a core's cache.
        env, params: what flies; parameters in which the slews' spacecraft differ have a leading
            axis (episodes,).
        key: of the slews of :func:`random_slews`.
        episodes: how many.
        progress: called now and then with how many have flown.

    Raises:
        ValueError: there are none, or something that came of them is not finite.
    """
    return _fly((controller,), env, params, key, (episodes, False, progress))


def fly_side_by_side(
    controllers: Crew, env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey, episodes: int
) -> list[Episodes]:
    """What comes of the same slews under each of several controllers, with how they hold.

    They are compiled together, which takes less time than one by one.

    Args:
        controllers: flight loops first.
        env, params, key, episodes: as of :func:`fly`.

    Raises:
        ValueError: there are no episodes, or something that came of them is not finite.
    """
    flown = _fly(controllers, env, params, key, (episodes, True, None))
    return [
        jax.tree.map(lambda x, n=n: x[n :: len(controllers)], flown)
        for n in range(len(controllers))
    ]


def _fly(controllers, env, params, key, how):
    """The slews of each controller, one slew after the other."""
    episodes, judges_holding, progress = how
    if (integer(episodes) or 0) < 1:
        raise ValueError(f"episodes is {episodes!r}; it must be an integer at least 1")
    keys = jax.random.split(key, episodes)
    calls = math.ceil(episodes / SLEWS_A_CALL)
    num_devices, blocks, size = _shape_of_call(math.ceil(episodes / calls), len(controllers))
    controllers = sharding.shared(controllers, num_devices)
    a_call, flown, axes = num_devices * blocks * size, [], parameters.fleet_axes(params)
    for start in range(0, episodes, a_call):
        rows = np.arange(start, start + a_call) % episodes  # to fill the last
        part = keys[rows].reshape(num_devices * blocks, size)
        theirs = _in_blocks(part.shape, axes, parameters.of_fleet(params, rows))
        block = fly_blocks(controllers, env, theirs, part, num_devices, judges_holding)
        flown.append(jax.device_get(block))
        if progress is not None:
            progress(min(start + a_call, episodes))
    slews = episodes * len(controllers)
    whole = jax.tree.map(lambda *x: np.concatenate(x).reshape(-1)[:slews], *flown)
    _check_finite(whole)
    return whole


def _check_finite(flown):
    """Raise an error that says in how many slews the first number is that is not finite."""
    for path, x in jax.tree_util.tree_leaves_with_path(flown):
        wrong = np.count_nonzero(~np.isfinite(x))
        if wrong:
            name = jax.tree_util.keystr(path, simple=True, separator=" ")
            raise errors.UserValueError(f"{name} is not finite in {wrong:,} of {len(x):,} slews")


def _in_blocks(shape, axes, params):
    """Parameters in which the spacecraft differ with the two leading axes of blocks of slews."""
    return jax.tree.map(
        lambda x, axis: x if axis is None else x.reshape(*shape, *x.shape[1:]), params, axes
    )


def _shape_of_call(slews, controllers):
    """Devices, blocks of each and slews of a block, of a call that flies at least so many."""
    devices, together = sharding.devices(), max(1, SLEWS_TOGETHER // controllers)
    if devices[0].platform != "cpu":
        return 1, 1, slews
    num_devices = min(len(devices), math.ceil(slews / together))
    blocks = math.ceil(slews / (num_devices * together))
    return num_devices, blocks, math.ceil(slews / (num_devices * blocks))
