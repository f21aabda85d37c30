"""How large a filter's errors are against what it says of them, over many flights."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from attjax.control import covariance, estimator, linearized, measured
from attjax.control.flight_loop import flight_loop
from attjax.dynamics import vectors
from attjax.envs.parameters import measured as told_of


class Consistency(NamedTuple):
    """Mean squares over the flights, each over its degrees of freedom: 1 if the filter is right.

    Attributes:
        errors: (steps, kinds) of attitude, rate and bias (NEES).
        innovations: (steps, 2) of the gyro and the star tracker (NIS), nan where nothing was told.
    """

    errors: np.ndarray
    innovations: np.ndarray


def flown(env, law, flights, steps):
    """The consistency of the loop's filter after each decision."""
    loop, params = flight_loop(law), env.default_params

    @jax.jit
    def fly(keys):
        states = jax.vmap(env.reset, (0, None))(keys, params)[1]
        context = env.context(params)
        memory = jax.vmap(lambda _: loop.init(context))(keys)

        def step(carry, _):
            memory, states = carry
            measurements = jax.vmap(told_of)(states)
            surprise = jax.vmap(innovation, (0, 0, None))(memory, measurements, context)
            act = jax.vmap(loop.step, (0, 0, None))
            action, memory = act(memory, measurements, context)
            errors = jnp.mean(jax.vmap(error)(memory.estimate, states), axis=0)
            states = jax.vmap(env.step_env, (0, 0, 0, None))(keys, states, action, params)[1]
            return (memory, states), (errors, jnp.nanmean(surprise, axis=0))

        return jax.lax.scan(step, (memory, states), None, length=steps)[1]

    return Consistency(*map(np.asarray, fly(jax.random.split(jax.random.key(1), flights))))


def error(estimate, state):
    """Of attitude, of rate and, where there is one, of bias, each squared by its covariance."""
    between = vectors.then(vectors.conjugate(estimate.quaternion), tuple(state.quaternion))
    sign = jnp.where(between[3] < 0, -2, 2)
    errors = [sign * x for x in between[:3]]
    errors += [x - y for x, y in zip(state.angular_velocity, estimate.angular_velocity)]
    if estimate.bias is not None:
        gyro = state.plant.sensing.gyro  # of scale factors nothing is asked
        truth = sum(x for x in (gyro.bias, gyro.wandered) if x is not None)
        errors += [x - y for x, y in zip(truth, estimate.bias)]
    spread = full(estimate.covariance)
    parts = [slice(n, n + 3) for n in range(0, len(errors), 3)]
    vector = jnp.stack(errors)
    return jnp.stack([squared(vector[part], spread[part, part]) for part in parts])


def innovation(memory, measurement, context):
    """Of gyro and star tracker, by what was predicted."""
    predicted, expected = estimator.predicted(
        memory.estimate, memory.expected, memory.queue, memory.time - 1, context
    )
    told, noise = estimator.told_by(measurement, context), linearized.noise(context)
    numbers = measured.innovations(predicted, expected, told, noise)
    rows = jnp.stack(
        [jnp.stack([jnp.asarray(0.0 if x is None else x) for x in n.row]) for n in numbers]
    )
    spread = rows @ full(predicted.covariance) @ rows.T
    spread = spread + jnp.diag(jnp.stack([n.variance for n in numbers]))
    surprise = jnp.stack([n.innovation for n in numbers])
    is_told = jnp.stack([numbers[0].is_told, numbers[3].is_told]) * (memory.time > 0)
    found = [squared(surprise[x], spread[x, x]) for x in (slice(0, 3), slice(3, 6))]
    return jnp.where(is_told > 0, jnp.stack(found), jnp.nan)


def squared(vector, spread):
    """vᵀ P⁻¹ v over its length, by the correlations, as single precision needs."""
    deviations = jnp.sqrt(jnp.diag(spread))
    correlations = spread / deviations[:, None] / deviations
    scaled = vector / deviations
    return scaled @ jnp.linalg.solve(correlations, scaled) / len(vector)


def full(triangle):
    size = len(triangle)
    return jnp.stack(
        [jnp.stack([covariance.at(triangle, i, j) for j in range(size)]) for i in range(size)]
    )
