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
from attjax.evaluation import paper
from attjax.evaluation.flown import Controller
from attjax.values import integer

RANDOM_SLEWS = 4
MAX_STEPS = 20_000
"""Agent steps of a slew; a page of that many has 15 MB."""

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
    histories = [
        _samples(start, evaluation.record(controller, env, params, key, start, steps))
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
        "flights": [[_encoded(one) for one in slew] for slew in zip(*histories)],
    }
    scripts = "\n".join(resources.read(f"{TEMPLATES}/{name}.js") for name in SCRIPTS)
    # "<" would let a name end the element that holds it.
    flights = json.dumps(content).replace("<", "\\u003c")
    style = resources.read(f"{TEMPLATES}/page.css")
    return resources.fill(f"{TEMPLATES}/page.html", style=style, script=scripts, flights=flights)


def _starts(env: AttitudeEnv, params: EnvParams, key: chex.PRNGKey) -> EnvState:
    random = evaluation.random_slews(env, params, key, RANDOM_SLEWS)[1]
    return jax.tree.map(lambda *x: jnp.concatenate(x), paper.table_5_slews(), random)


def _slew_names(start):
    angles = np.rad2deg(jax.vmap(quaternions.error_angle)(start.quaternion))
    names = [f"Table 5, test {number}" for number in range(1, len(paper.TABLE_5) + 1)]
    names += [f"random {number}" for number in range(1, RANDOM_SLEWS + 1)]
    return [f"{name}: {angle:.1f}°" for name, angle in zip(names, angles)]


def _samples(start, history):
    """(slews, steps + 1, 10): quaternion, angular velocity, torque of the step from there."""
    quaternion = np.concatenate([start.quaternion[None], history.quaternion])
    velocity = np.concatenate([start.angular_velocity[None], history.angular_velocity])
    torque = np.concatenate([history.torque, np.zeros_like(history.torque[:1])])
    return np.concatenate([quaternion, velocity, torque], axis=-1).swapaxes(0, 1)


def _encoded(samples):
    return base64.b64encode(samples.astype("<f4").tobytes()).decode()
