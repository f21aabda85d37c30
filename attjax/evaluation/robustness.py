"""How far controllers get in worlds that are not perfect: a row for each condition."""

import dataclasses
import functools
import math
from collections.abc import Callable, Mapping
from concurrent import futures
from typing import Any, cast

import jax
import numpy as np

from attjax import evaluation
from attjax.control.assured import assurance
from attjax.control.flight_loop import flight_loop
from attjax.envs.attitude import AttitudeEnv
from attjax.evaluation.blocks import fly_blocks
from attjax.evaluation.episodes import Episodes, fly_side_by_side
from attjax.evaluation.flown import Controller
from attjax.evaluation.ladder import conditions
from attjax.ppo.crew import Crew
from attjax.ppo.networks import Policy
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
        adaptive: whether each controller flies in a loop that adapts, too; none does with wheels.
        assured: whether run-time assurance follows every flight loop.
    """

    env: AttitudeEnv
    episodes: int = 1000
    seed: int = 0
    adaptive: bool = False
    assured: bool = False


def robustness(
    controllers: Mapping[str, Controller],
    flights: Flights,
    progress: Callable[[int, int], None] | None = None,
) -> list[dict]:
    """Fly the ladder of :func:`attjax.evaluation.ladder.conditions`.

    All controllers fly the same slews through the same draws, in a flight loop and without one. A
    policy that flies any spacecraft flies that of each named world, as the classical laws do.

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
        if env.spacecraft == flights.env.spacecraft or _flies_any(controller)
    }
    rows = list(_flown(able, env, flights, name))
    # No other condition flies these programs, and all of the ladder's would be more than the
    # 65,530 memory maps that Linux gives a process.
    cast(Any, fly_blocks).clear_cache()
    return rows


def environment(env: AttitudeEnv, world: World) -> AttitudeEnv:
    """The simulator in a world: with the spacecraft that this was described for, if another."""
    spacecraft = made_for(world)
    if spacecraft == LM50:
        spacecraft = env.spacecraft
    return dataclasses.replace(env, world=world, spacecraft=spacecraft)


def _flies_any(controller):
    """Whether it is a classical law, or a policy of any spacecraft."""
    policy = _policy_of(controller)
    return not jax.tree.leaves(controller) or (policy is not None and policy.is_universal)


def _policy_of(controller):
    """The policy whose ``act`` it is; None of a classical law."""
    owner = getattr(getattr(controller, "func", None), "__self__", None)
    return owner if isinstance(owner, Policy | Crew) else None


def _flown(controllers, env, flights, name):
    plain: Any = tuple(jax.tree_util.Partial(x) for x in controllers.values())
    guard = assurance(env) if flights.assured else None
    crews = {False: (*_loops(controllers, guard, adapts=False), *plain)}
    if flights.adaptive and env.world.wheels is None:
        crews[True] = _loops(controllers, guard, adapts=True)
    params, key = env.default_params, jax.random.key(flights.seed)
    for adapts, crew in crews.items():
        flown = fly_side_by_side(crew, env, params, key, flights.episodes)
        for number, of_this in enumerate(flown):
            has_loop, controller = number < len(plain), list(controllers)[number % len(plain)]
            row = {"condition": name, "controller": controller, "flight_loop": has_loop}
            row |= {"adaptive": adapts, "assured": has_loop and flights.assured}
            yield row | outcome(of_this, env)


def _loops(controllers, guard, adapts):
    return tuple(_loop(x, guard, adapts) for x in controllers.values())


def _loop(controller, guard, adapts):
    policy = _policy_of(controller)
    if guard is None or policy is None:
        return flight_loop(controller, adapts=adapts, assurance=guard)
    scores = jax.tree_util.Partial(policy.scores, *controller.args)
    return flight_loop(controller, adapts=adapts, assurance=guard, scores=scores)


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
