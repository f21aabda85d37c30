"""How far controllers get in worlds that are not perfect: a row for each condition."""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from concurrent import futures
from typing import Any

import jax
import numpy as np

from attjax import evaluation
from attjax.control.flight_loop import flight_loop
from attjax.envs.attitude import AttitudeEnv
from attjax.evaluation.episodes import Episodes, fly_side_by_side
from attjax.evaluation.flown import Controller
from attjax.evaluation.ladder import conditions
from attjax.spacecraft import LM50
from attjax.world import World, made_for

CONDITIONS_AT_ONCE = 2
"""One is compiled while another flies."""


@dataclasses.dataclass(frozen=True)
class Flights:
    """What is flown in each condition.

    Attributes:
        env: whose spacecraft, control rate and rules hold in all conditions but named worlds that
            are of another spacecraft.
        episodes: slews of each controller, with its flight loop and without.
        seed: of the slews, and of what each condition leaves open.
    """

    env: AttitudeEnv
    episodes: int = 1000
    seed: int = 0


def robustness(
    controllers: Mapping[str, Controller],
    flights: Flights,
    progress: Callable[[int, int], None] | None = None,
) -> list[dict]:
    """Fly the ladder of :func:`attjax.evaluation.ladder.conditions`.

    All controllers fly the same slews through the same draws, in a flight loop and without one.

    Args:
        controllers: plain ones by name, ``act(observation, context) -> action``.
        flights: of each condition.
        progress: told how many conditions of how many have been flown.

    Returns:
        A row for each condition, controller and loop, as ``eval.py --robustness --json`` has them.

    Raises:
        ValueError: there are no episodes.
    """
    env = flights.env
    ladder = conditions(env.spacecraft, env.frameskip)
    fly = functools.partial(_rows, controllers, flights)
    with futures.ThreadPoolExecutor(CONDITIONS_AT_ONCE) as pool:
        found: dict[str, list[dict]] = {}
        for name, rows in zip(ladder, pool.map(fly, ladder, ladder.values())):
            found[name] = rows
            if progress is not None:
                progress(len(found), len(ladder))
    return [row for rows in found.values() for row in rows]


def _rows(controllers, flights, name, world):
    """The rows of a condition."""
    env = environment(flights.env, world)
    able = {
        x: controller
        for x, controller in controllers.items()
        if env.spacecraft == flights.env.spacecraft or _is_classical(controller)
    }
    return list(_flown(able, env, flights, name))


def environment(env: AttitudeEnv, world: World) -> AttitudeEnv:
    """The simulator in a world: with the spacecraft that this was described for, if another."""
    spacecraft = made_for(world)
    if spacecraft == LM50:
        spacecraft = env.spacecraft
    return dataclasses.replace(env, world=world, spacecraft=spacecraft)


def _is_classical(controller):
    return not jax.tree.leaves(controller)


def _flown(controllers, env, flights, name):
    plain = [jax.tree_util.Partial(x) for x in controllers.values()]
    crew: Any = (*map(flight_loop, plain), *plain)
    params, key = env.default_params, jax.random.key(flights.seed)
    flown = fly_side_by_side(crew, env, params, key, flights.episodes)
    names = [(x, has_loop) for has_loop in (True, False) for x in controllers]
    for (controller, has_loop), of_this in zip(names, flown):
        row = {"condition": name, "controller": controller, "flight_loop": has_loop}
        yield row | outcome(of_this, env)


def outcome(flown: Episodes, env: AttitudeEnv) -> dict[str, Any]:
    """What a row says of its flights.

    Pointing is over the last fifth of those that did not pass the rate limit, settling that of the
    successes in the mean; None where there are none.
    """
    success = evaluation.successes(flown, env.default_params)
    whole = ~np.asarray(flown.overspeed)
    settled = evaluation.settling_times(flown, env)[success]
    holding: Any = flown.holding
    return {
        "episodes": len(success),
        "success_rate": float(np.mean(success)),
        "overspeed_rate": float(np.mean(~whole)),
        "rms_deg": _root_mean_deg(holding.squared[whole]),
        "max_deg": float(np.rad2deg(holding.most[whole].max())) if whole.any() else None,
        "estimate_rms_deg": _root_mean_deg(holding.estimate_squared[whole]),
        "settling_time_s": float(settled.mean()) if success.any() else None,
        "impulse_N_m_s": float(np.mean(flown.impulse, dtype=float)),
    }


def _root_mean_deg(squares):
    if len(squares) == 0:
        return None
    return float(np.rad2deg(np.sqrt(np.mean(squares, dtype=float))))


def wilson(share: float, count: int) -> tuple[float, float]:
    """The 95 % interval of a share that was seen in so many flights (Wilson 1927).

    Example:
        >>> [round(x, 4) for x in wilson(1.0, 1000)]
        [0.9962, 1.0]
    """
    z = 1.959964
    middle = share + z * z / (2 * count)
    half = z * math.sqrt(share * (1 - share) / count + (z / (2 * count)) ** 2)
    whole = 1 + z * z / count
    return max((middle - half) / whole, 0.0), min((middle + half) / whole, 1.0)
