"""What error can be held near the goal, by a planner that looks hundreds of periods ahead.

python benchmarks/holding.py --checkpoint pretrained/universal --slews 20
python benchmarks/holding.py --checkpoint pretrained/universal --slews 20 --torque 0.005

The policy flies a slew of each spacecraft of a fleet, or of LM50 under a known constant torque in
any direction. From where it is 400 control periods before the end, a beam search over its 19
torques looks for the sequence of least mean error, in the double integrators that a spacecraft is
near the goal (attjax.control.own_units). It knows the model to the last digit and has no time
limit: no controller need be able to do as well, and wider beams still find better ones.
"""

import argparse
import json

import jax
import jax.numpy as jnp
import numpy as np

from attjax import AttitudeEnv, load_policy
from attjax.control.own_units import OwnUnits
from attjax.control.torque_order import ordered
from attjax.envs import parameters
from attjax.evaluation.fleets import params_of, quantisation

LAST, AHEAD = 400, 220
"""Control periods: of the flight's end, and that the planner looks ahead."""

COUNTED = slice(80, 200)
"""Of those that it looks ahead, in which errors are compared: neither a start nor an end."""


def main() -> None:
    """Fly, plan and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--checkpoint", default="pretrained/universal")
    parser.add_argument("--slews", type=int, default=20)
    parser.add_argument("--width", type=int, default=1000, help="of the beam")
    parser.add_argument("--torque", type=float, help="on LM50, N m; without it: a fleet")
    given = parser.parse_args()
    env = AttitudeEnv(5)
    params = params_of(env, given.slews, 0)
    if given.torque is not None:
        random = np.random.default_rng(0).normal(size=(given.slews, 3))
        unit = random / np.linalg.norm(random, axis=1, keepdims=True)
        params = env.default_params.replace(disturbance=jnp.asarray(given.torque * unit, float))
    errors = []
    for n, (units, quaternion, rate, least) in enumerate(flown(env, params, given)):
        angles = np.linalg.norm(2 * quaternion[:, :3], axis=1)
        if np.mean(angles[COUNTED]) > env.default_params.goal_angle:
            continue  # it has not arrived
        planned = held(units, 2 * quaternion[0, :3], rate[0], given.width)
        errors.append((np.mean(angles[COUNTED]), np.mean(planned[COUNTED]), least))
        row = dict(zip(("policy_deg", "planner_deg", "quantisation_deg"), np.rad2deg(errors[-1])))
        print(json.dumps({"slew": n} | row), flush=True)
    policy, planner, least = np.array(errors).T
    told = {"policy_over_planner": np.mean(policy) / np.mean(planner)}
    told |= {"policy_over_quantisation": np.mean(policy) / np.mean(least)}
    told |= {"planner_over_quantisation": np.mean(planner) / np.mean(least)}
    print(json.dumps(told | {"width": given.width, "slews": len(errors)}))


def flown(env, params, given):
    """Own units, attitudes and rates of the last periods, and quantisation, rad, of each slew."""
    policy, steps = load_policy(given.checkpoint), int(env.default_params.max_steps_in_episode)

    def fly(key, params):
        context = env.context(params)

        def step(state, _):
            action = policy(env.observe(key, state, params), context)
            following = env.step_env(key, state, action, params)[1]
            return following, (state.quaternion, state.angular_velocity)

        states = jax.lax.scan(step, env.reset(key, params)[1], None, steps)[1]
        last = jax.tree.map(lambda x: x[-LAST:], states)
        return OwnUnits.of(ordered(context)), *last, quantisation(context)

    keys = jax.random.split(jax.random.key(0), given.slews)
    axes = parameters.fleet_axes(params)
    found = jax.jit(jax.vmap(fly, (0, axes)))(keys, params)
    for n in range(given.slews):
        yield jax.tree.map(lambda x, n=n: np.asarray(x[n], float), found)


def held(units, turn, rate, width):
    """Error angles, rad, of the best of the sequences that a beam of this width comes to."""
    impulses = np.zeros((19, 3))
    levels = np.array([1, *units.levels])
    for level, axis in np.ndindex(3, 3):
        impulses[1 + 6 * level + 2 * axis, axis] = levels[level]
        impulses[2 + 6 * level + 2 * axis, axis] = -levels[level]
    radians = np.linalg.inv(units.momentum) * units.period
    p = (units.momentum @ rate)[None]
    # What acts all through the period moves it by half of what comes at its beginning does.
    share = units.duration / (2 * units.period)
    z = units.momentum @ turn / units.period + share * p
    cost, angles = np.zeros(1), np.zeros((1, 0))
    for _ in range(AHEAD):
        following_p = p[:, None] + impulses
        following_z = z[:, None] + following_p + (0.5 + share) * units.push
        following_p = following_p + units.push
        angle = np.linalg.norm((following_z - share * following_p) @ radians.T, axis=-1)
        total = cost[:, None] + angle
        ahead = np.linalg.norm((following_z + following_p) @ radians.T, axis=-1)
        debt = abs(following_p) * np.maximum(abs(following_p), 0.5)  # stopped by impulses of 1
        debt = np.linalg.norm(debt * np.linalg.norm(radians, axis=0), axis=-1)
        kept = _best((total + ahead + debt).ravel(), following_z, following_p, levels[-1], width)
        z, p = following_z.reshape(-1, 3)[kept], following_p.reshape(-1, 3)[kept]
        angles = np.append(angles[kept // len(impulses)], angle.ravel()[kept, None], axis=1)
        cost = total.ravel()[kept]
    return angles[np.argmin(cost)]


def _best(rank, z, p, smallest, width):
    """Rows of the best states, of those that are nearly the same the best one alone."""
    most = min(rank.size, 4 * width)
    rows = np.argpartition(rank, most - 1)[:most]
    rows = rows[np.argsort(rank[rows])]
    cells = np.concatenate([x.reshape(-1, 3)[rows] for x in (z, p)], axis=1)
    cells = np.round(cells / (0.2 * smallest)).astype(np.int64)
    first = np.sort(np.unique(cells, axis=0, return_index=True)[1])
    return rows[first[:width]]


if __name__ == "__main__":
    main()
