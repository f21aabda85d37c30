"""One controller on many spacecraft: which, and how near it comes to what each of them can."""

import itertools
from collections.abc import Callable

import chex
import jax
import jax.numpy as jnp
import numpy as np

from attjax.control.flight_loop import FlightLoop
from attjax.control.time_optimal import rate_limited_reference
from attjax.dynamics import rigid_body
from attjax.dynamics.numerics import matmul
from attjax.envs import fleet, parameters
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.context import Context
from attjax.envs.parameters import EnvParams
from attjax.evaluation.blocks import Episodes
from attjax.evaluation.episodes import fly, random_slews
from attjax.evaluation.flown import Controller
from attjax.evaluation.summary import conditions, settling_times, statistics, successes

CELL = 8
"""Points along each edge of a cell of what a spacecraft can be turned by."""

NEVER_TRAINED = 2**32 - 1
"""What stands, in an evaluation's seed, where a training run has the number of its fleet."""


def evaluate_fleet(
    controller: Controller,
    env: AttitudeEnv | None = None,
    *,
    episodes: int = 5000,
    seed: int = 0,
    progress: Callable[[int], None] | None = None,
) -> dict:
    """Judge a controller over slews of as many spacecraft, as ``eval.py --fleet`` does.

    Args:
        controller, episodes, seed, progress: as of :func:`attjax.evaluation.evaluate`; the seed
            draws the spacecraft, too.
        env: whose goal, duration and control rate they have; by default LM50's, at 40 Hz.

    Returns:
        What ``evaluate`` returns, and :func:`ratios`.

    Raises:
        ValueError: there are no episodes, or the world is not ideal.

    Example:
        >>> from attjax.control.classical import phase_plane
        >>> judged = evaluate_fleet(phase_plane, AttitudeEnv(frameskip=20), episodes=20)
        >>> judged["spacecraft"], judged["success_rate"] > 0.8
        ('any', True)
    """
    env = AttitudeEnv(frameskip=5) if env is None else env
    if not env.world.is_ideal:
        raise ValueError(f"the world is {env.world}; a fleet flies in the ideal one")
    if not isinstance(controller, FlightLoop):
        controller = jax.tree_util.Partial(controller)
    params, key = params_of(env, episodes, seed), jax.random.key(seed)
    flown = fly(controller, env, params, key, episodes, progress)
    told = conditions(env, params, seed, episodes) | {"spacecraft": "any"}
    return told | statistics(flown, env, params) | ratios(flown, env, params, key)


def params_of(env: AttitudeEnv, episodes: int, seed: int) -> EnvParams:
    """Parameters of another spacecraft for each slew, drawn as those that ``universal`` trains on.

    Nothing is wrong with any of them.

    Args:
        env: whose episodes, goal and control rate they have.
        episodes: how many.
        seed: that they are drawn by; no training draws by the same numbers.
    """
    random = np.random.default_rng([seed, NEVER_TRAINED])
    drawn = fleet.draw(random, np.full(episodes, env.frameskip))
    return env.default_params.replace(**drawn.parameters())


def ratios(
    flown: Episodes, env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey
) -> dict[str, float | None]:
    """Of the successes: mean settling time over mean estimate, and terminal error over its limit.

    Args:
        flown: what came of the slews.
        env, params, key: of them, as of :func:`attjax.evaluation.fly`.

    Returns:
        "settling_over_estimate", by :func:`attjax.control.time_optimal.rate_limited_reference`, and
        "terminal_over_quantisation", by :func:`quantisation`; None where there is no success.
    """
    count, axes = len(flown.terminal_angle), parameters.fleet_axes(params)
    starts = random_slews(env, params, key, count)[1]

    def of_one(quaternion, params):
        context = env.context(params)
        return rate_limited_reference(quaternion, context), quantisation(context)

    estimate, limit = jax.jit(jax.vmap(of_one, (0, axes)))(starts.quaternion, params)
    success = successes(flown, params)
    if not np.any(success):
        return {"settling_over_estimate": None, "terminal_over_quantisation": None}

    def ratio(values, of):
        return float(np.mean(values[success]) / np.mean(np.asarray(of, float)[success]))

    return {
        "settling_over_estimate": ratio(settling_times(flown, env), estimate),
        "terminal_over_quantisation": ratio(np.asarray(flown.terminal_angle, float), limit),
    }


def quantisation(context: Context) -> chex.Array:
    """Mean error angle, rad, of a spacecraft as near to the goal as its torques let it stand.

    The smallest impulses about the torque axes turn it, in a control period, by the edges of a
    cell. Attitudes at rest are cells apart; on average the nearest is as far from the goal as a
    point of the cell from its middle.
    """
    smallest = context.torque_table[-6::2]
    inertia = context.inertia
    tensor = jnp.diag(inertia) if inertia.ndim == 1 else inertia
    rate = matmul(smallest, rigid_body.inverse(tensor))
    edges = rate * context.torque_duration * context.control_period
    places = (np.arange(CELL) + 0.5) / CELL - 0.5
    points = np.array(list(itertools.product(places, repeat=3)), np.float32)
    return jnp.mean(jnp.linalg.norm(matmul(points, edges), axis=1))
