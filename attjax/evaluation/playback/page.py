"""A web page that replays slews in 3-D: one file that needs no other, and no network."""

import base64
import json

import chex
import jax
import jax.numpy as jnp
import numpy as np

import attjax
from attjax import evaluation, resources
from attjax.dynamics import quaternion as quaternions
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.parameters import EnvParams, EnvState
from attjax.envs.worlds import placed
from attjax.evaluation import paper
from attjax.evaluation.flight import truth_is_told
from attjax.evaluation.flown import Controller
from attjax.values import integer

RANDOM_SLEWS = 4
MAX_STEPS = 20_000
"""Agent steps of a slew; a page of that many has 15 MB, and 21 MB with what was believed."""

TEMPLATES = "evaluation/playback"
SCRIPTS = ("scene", "draw", "curves", "player", "controls")


def page(
    controllers: dict[str, Controller],
    env: AttitudeEnv,
    params: EnvParams,
    seed: int,
    checkpoint: str | None = None,
) -> str:
    """The HTML of a page that replays the same slews under each controller, side by side.

    The slews are those of Table 5, and the first random ones of the seed.

    Args:
        controllers: by the names that the page shows.
        env, params: what they fly, for ``params.max_steps_in_episode`` steps each.
        seed: of the random slews, as in :func:`attjax.evaluation.fly`.
        checkpoint: where the policy comes from, in a word, to be shown; None: not shown.
    """
    key = jax.random.key(seed)
    start = _starts(env, params, key)
    steps = int(params.max_steps_in_episode)
    histories = [  # with one more decision, so that of the last sample too a belief is known
        evaluation.record(controller, env, params, key, start, steps + 1)
        for controller in controllers.values()
    ]
    content = {
        "version": attjax.__version__,
        "controlPeriod": env.control_period,
        "spacecraft": env.spacecraft.name,
        "pulse": float(env.context(params).torque_duration),
        "frameskip": env.frameskip,
        "steps": steps,
        "seed": integer(seed),
        "checkpoint": checkpoint,
        "inertia": np.asarray(params.inertia).tolist(),
        "rateLimit": float(params.rate_limit),
        "goalAngle": float(params.goal_angle),
        "controllers": list(controllers),
        "slews": _slew_names(start),
        "flights": _encoded([_samples(start, history) for history in histories]),
    } | _of_world(env, params, histories)
    scripts = "\n".join(resources.read(f"{TEMPLATES}/{name}.js") for name in SCRIPTS)
    # "<" would let a name end the element that holds it.
    flights = json.dumps(content).replace("<", "\\u003c")
    style = resources.read(f"{TEMPLATES}/page.css")
    return resources.fill(f"{TEMPLATES}/page.html", style=style, script=scripts, flights=flights)


def _starts(env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey) -> EnvState:
    random = evaluation.random_slews(env, params, key, RANDOM_SLEWS)[1]
    tests = paper.table_5_slews()
    keys = jax.random.split(key, len(tests.time))  # as record's, so that figures show the same
    tests = jax.vmap(placed, (None, 0, 0, None))(env, keys, tests, params)
    return jax.tree.map(lambda *x: jnp.concatenate(x), tests, random)


def _of_world(env, params, histories):
    """What the page holds of a world, nothing of the ideal one."""
    content = {}
    if not env.world.is_ideal:
        content["world"] = env.world.name
        if env.actions == "discrete":  # the weakest that can be commanded about an axis, N m
            torques = np.abs(params.torque_table)
            content["leastTorque"] = float(torques[torques > 0].min(initial=torques.max()))
    if not truth_is_told(env, params):
        content["beliefs"] = _encoded([history.believed for history in histories])
    return content


def _slew_names(start):
    angles = np.rad2deg(jax.vmap(quaternions.error_angle)(start.quaternion))
    names = [f"Table 5, test {number}" for number in range(1, len(paper.TABLE_5) + 1)]
    names += [f"random {number}" for number in range(1, RANDOM_SLEWS + 1)]
    return [f"{name}: {angle:.1f}°" for name, angle in zip(names, angles)]


def _samples(start, history):
    """(steps + 1, slews, 10): quaternion, angular velocity, torque of the step from there."""
    quaternion = np.concatenate([start.quaternion[None], history.quaternion[:-1]])
    velocity = np.concatenate([start.angular_velocity[None], history.angular_velocity[:-1]])
    torque = np.concatenate([history.torque[:-1], np.zeros_like(history.torque[:1])])
    return np.concatenate([quaternion, velocity, torque], axis=-1)


def _encoded(arrays):
    """Text of (steps + 1, slews, ...) of each controller: a list of slews, each of controllers."""
    slews = zip(*(np.asarray(x, "<f4").swapaxes(0, 1) for x in arrays))
    return [[base64.b64encode(one.tobytes()).decode() for one in slew] for slew in slews]
