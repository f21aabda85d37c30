"""Tries to exceed the rate limit under the mask: random spacecraft, and who steers them ill.

Each spacecraft starts at rest. Its adversary knows what every action leads to, as the simulator
does, and takes an allowed one: at random, the one with the highest peak rate after it, or the one
that exceeds a first-order forecast of the peak the most.

Example:
    python tests/helpers/adversary.py --spacecraft 1000
"""

import argparse
import functools
import itertools
import sys

import jax
import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from attjax import EnvState, Spacecraft, dynamics
from attjax.control import assurance
from attjax.dynamics import rigid_body
from attjax.envs import parameters, simulator
from attjax.envs.attitude import AttitudeEnv

MARGIN = 0.99
ADVERSARIES = ("random", "highest", "surprising")
FORMS = ("moments", "tensor")
"""Of the inertia; a batch has one."""

KINDS = {
    "pulses, limit 0.001 to 5 rad/s": (False, (0, 20), (1e-3, 5)),
    "pulses, limit 5 to 100 rad/s": (False, (0, 20), (5, 100)),
    "held up to 0.1 s": (True, (0, 23), (1e-3, 5)),
    "held 0.1 to 1 s": (True, (24, 239), (1e-3, 5)),
    "held up to 1 s, limit 5 to 100 rad/s": (True, (0, 239), (5, 100)),
}
"""Random spacecraft: whether torques are held, RK4 steps after the first, rate limits in rad/s."""


def random_spacecraft(rng, kind, form, frameskip, steps) -> Spacecraft:
    """Any that is accepted: flat, long and round bodies, in any axes, gentle and violent."""
    while True:
        try:
            return _random_description(rng, kind, form, frameskip, steps)
        except ValueError as error:
            assert "single precision" in str(error)


def _random_description(rng, kind, form, frameskip, steps):
    held, _, limits = KINDS[kind]
    least = 10 ** rng.uniform(-2.9, 0)
    shortest = max(least, 1 - least)  # no rigid body has a middle moment below it
    middle = rng.choice([shortest, rng.uniform(shortest, 1), 1])
    moments = rng.permutation([least, middle, 1]) * 10 ** rng.uniform(-2, 1)
    inertia = moments
    if form == "tensor":
        turned = Rotation.random(random_state=rng.integers(2**31)).as_matrix()
        inertia = turned @ np.diag(moments) @ turned.T
        inertia = (inertia + inertia.T) / 2
    limit = np.exp(rng.uniform(*np.log(limits)))
    duration = (1 + frameskip) / 240 if held else 1 / 240
    # The change of rate by the largest torque, of the limit; within 1/240 s no more than all of it.
    share = min(10 ** rng.uniform(-2, 0.5), 0.99 * duration * 240)
    return Spacecraft(
        inertia=inertia,
        torque_levels=share * limit * min(moments) / duration * np.array([1, 0.3, 0.05]),
        torque_axes=np.eye(3) if rng.uniform() < 0.5 else rng.normal(size=(3, 3)),
        torque_held=held,
        rate_limit=limit,
        duration=steps * (1 + frameskip) / 240,
    )


def batch(kind: str, form: str, count: int, steps: int, seed: int):
    """An environment and the parameters of ``count`` random spacecraft, each at its own rate."""
    least, most = KINDS[kind][1]
    rng = np.random.default_rng(seed)
    frameskips = rng.integers(least, most, count, endpoint=True)
    crafts = [random_spacecraft(rng, kind, form, frameskip, steps) for frameskip in frameskips]
    params = [
        parameters.default_params(0, craft).replace(frameskip=jnp.array(frameskip, jnp.int32))
        for craft, frameskip in zip(crafts, frameskips)
    ]
    return AttitudeEnv(most, spacecraft=crafts[0]), jax.tree.map(lambda *x: jnp.stack(x), *params)


def highest_peaks(kind: str, form: str, adversary: str, count: int, steps: int, seed: int = 0):
    """Fly ``count`` random spacecraft from rest.

    Returns:
        (count,) the highest peak rate that each comes to, as a share of its limit, and the mean
        share of the actions that were allowed.
    """
    env, params = batch(kind, form, count, steps, seed)
    keys = jax.random.split(jax.random.key(seed), (count, steps))
    return map(np.asarray, _fly(env, adversary, params, keys))


@functools.partial(jax.jit, static_argnums=(0, 1))
def _fly(env, adversary, params, keys):
    def fly(params, keys):
        def step(state, key):
            wish = functools.partial(_wish, adversary, params, env.context(params))
            mask = assurance.rate_mask(env.context(params), MARGIN)
            allowed = mask.allowed(state.angular_velocity)
            states = jax.vmap(lambda a: simulator.step(state, a, params, env.frameskip))(
                jnp.arange(len(allowed))
            )
            peaks = rigid_body.peak_rate(states.angular_velocity, params.inertia)
            wishes = wish(state.angular_velocity, peaks, jax.random.uniform(key, allowed.shape))
            chosen = jnp.argmax(jnp.where(allowed, wishes, -jnp.inf))
            state = jax.tree.map(lambda x: x[chosen], states)
            return state, (peaks[chosen] / params.rate_limit, jnp.mean(allowed.astype(float)))

        rest = EnvState(jnp.array([0.0, 0, 0, 1]), jnp.zeros(3), jnp.array(0, jnp.int32))
        _, (peaks, allowed) = jax.lax.scan(step, rest, keys)
        return jnp.max(peaks), jnp.mean(allowed)

    return jax.vmap(fly)(params, keys)


def _wish(adversary, params, context, angular_velocity, peaks, noise):
    """How much the adversary likes each action."""
    if adversary == "random":
        return noise
    wish = peaks + 1e-3 * params.rate_limit * noise
    if adversary == "highest":
        return wish
    forecast = dynamics.rate_after_impulse(
        angular_velocity, params.torque_table, params.inertia, context.torque_duration
    )
    return wish - rigid_body.peak_rate(forecast, params.inertia)


def main(argv=None) -> int:
    """Print a table of what the adversaries reach; returns 1 if one exceeds the limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--spacecraft", type=int, default=1000, help="of each kind")
    parser.add_argument("--steps", type=int, default=500, help="actions of each")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args(argv)
    worst = 0.0
    print("| | adversary | highest peak rate, of the limit | beyond the limit | actions allowed |")
    print("|---|---|---|---|---|")
    for kind, adversary in itertools.product(KINDS, ADVERSARIES):
        flown = [
            highest_peaks(
                kind, form, adversary, arguments.spacecraft // 2, arguments.steps, arguments.seed
            )
            for form in FORMS
        ]
        peaks, allowed = map(np.concatenate, zip(*flown))
        beyond = np.mean(~(peaks <= 1))
        cells = kind, adversary, f"{peaks.max():.4f}", f"{beyond:.1%}", f"{allowed.mean():.0%}"
        print(f"| {' | '.join(cells)} |", flush=True)
        worst = max(worst, float(peaks.max()))
    return int(not worst <= 1)


if __name__ == "__main__":
    sys.exit(main())
