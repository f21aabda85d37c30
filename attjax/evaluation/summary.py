"""A controller judged: statistics of what came of its slews (Table 2)."""

from collections.abc import Callable

import jax
import numpy as np

from attjax.control.flight_loop import FlightLoop
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.parameters import EnvParams
from attjax.evaluation.episodes import Episodes, fly
from attjax.evaluation.flown import Controller
from attjax.values import integer

STATISTICS = ("mean", "std", "min", "q1", "q2", "q3", "max")


def evaluate(
    controller: Controller,
    env: AttitudeEnv | None = None,
    *,
    episodes: int = 5000,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> dict:
    """Judge a controller over random slews, as ``eval.py`` does.

    Args:
        controller: ``act(observation, context) -> action``: a policy of ``attjax.load_policy``
            or of ``attjax.train(...)``, a classical law, any function of one's own, told what the
            sensors say; or one in a flight loop (:func:`attjax.flight_loop`), told an estimate.
        env: what flies, and its control rate; by default LM50 at 40 Hz, as in Table 2.
        episodes: number of slews.
        seed: of their starts.
        progress: called now and then with how many have flown.

    Returns:
        The conditions and the statistics, as ``eval.py --json`` writes them.

    Raises:
        ValueError: there are no episodes.

    Example:
        >>> from attjax.control.classical import phase_plane
        >>> evaluate(phase_plane, AttitudeEnv(frameskip=20), episodes=10)["success_rate"]
        1.0
    """
    env = AttitudeEnv(frameskip=5) if env is None else env
    params, key = env.default_params, jax.random.key(seed)
    if not isinstance(controller, FlightLoop):
        controller = jax.tree_util.Partial(controller)
    flown = fly(controller, env, params, key, episodes, progress)
    return conditions(env, params, seed, episodes) | statistics(flown, env, params)


def conditions(env: AttitudeEnv, params: EnvParams, seed: int, episodes: int) -> dict:
    """What the episodes of :func:`fly` have in common, for ``eval.py --json``.

    Their world's name is told where it is not the ideal one.
    """
    world = {} if env.world.is_ideal else {"world": env.world.name}
    return {
        "episodes": integer(episodes),
        "frameskip": env.frameskip,
        "control_hz": 1 / env.control_period,
        "duration_s": int(params.max_steps_in_episode) * env.control_period,
        "seed": integer(seed),
    } | world


def statistics(flown: Episodes, env: AttitudeEnv, params: EnvParams) -> dict:
    """The statistics that ``eval.py --json`` writes of the flown episodes.

    Settling times are those of the successes; the other episodes are counted in ``never``.
    """
    success = successes(flown, params)
    flown = jax.tree.map(lambda x: np.asarray(x).astype(float), flown)
    settling = settling_times(flown, env)[success]
    return {
        "success_rate": float(np.mean(success)),
        "overspeed_rate": float(np.mean(flown.overspeed)),
        "closest": _pointing(flown.closest_angle, flown.closest_rate),
        "terminal": _pointing(flown.terminal_angle, flown.terminal_rate),
        "terminal_success": _pointing(flown.terminal_angle[success], flown.terminal_rate[success]),
        "settling_time_s": summarize(settling) | {"never": len(success) - len(settling)},
        "episode_return": summarize(flown.score),
        "impulse_N_m_s": summarize(flown.impulse),
    }


def successes(flown: Episodes, params: EnvParams) -> np.ndarray:
    """(episodes,) bool: φ within the goal angle at the end, the rate limit never exceeded."""
    return np.asarray((flown.terminal_angle <= params.goal_angle) & ~flown.overspeed)


def settling_times(flown: Episodes, env: AttitudeEnv) -> np.ndarray:
    """Time of the first sample from which φ stays within the goal angle, s, (episodes,)."""
    return (np.asarray(flown.last_outside) + 1) * env.control_period


def summarize(x: np.ndarray) -> dict:
    """Mean, standard deviation, extremes and quartiles; all None for no samples.

    Example:
        >>> summarize(np.array([1.0, 2.0, 3.0]))["q2"]
        2.0
    """
    if len(x) == 0:
        return dict.fromkeys(STATISTICS)
    quartiles = np.quantile(x, [0, 0.25, 0.5, 0.75, 1])
    values = [np.mean(x), np.std(x), *quartiles]
    return {name: float(value) for name, value in zip(STATISTICS, values)}


def _pointing(angle, rate):
    return {"error_deg": summarize(np.rad2deg(angle)), "rate_rad_s": summarize(rate)}
