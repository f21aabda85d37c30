"""The matrix products of an update and nothing else: how fast training could be at most.

Linear networks of the same sizes are trained by gradient descent, written out in products, so
that each product is needed and none stays the same from step to step.
"""

import jax
import jax.numpy as jnp
from contenders import Workload

OBSERVATIONS, ACTIONS = 11, 19
RATE = 1e-4
"""So small that the numbers keep their size; no compiler can leave it out for that."""


def prepare_rollout(workload: Workload):
    """A function that does the products of a rollout: both networks forward."""
    networks = random_networks(workload.hidden_sizes)
    x = random_observations(workload.num_envs)

    def step(x, _):
        outputs = [forward(weights, x)[-1] for weights in networks]
        return x + RATE * sum(jnp.max(y, axis=1, keepdims=True) for y in outputs), None

    return compiled(lambda x: jax.lax.scan(step, x, length=workload.rollout_length)[0], x)


def prepare_pass(workload: Workload):
    """A function that does the products of one pass: both networks forward and backward."""
    networks = random_networks(workload.hidden_sizes)
    x = random_observations(workload.minibatch_size)

    def step(networks, _):
        return [descend(weights, x) for weights in networks], None

    def one_pass(networks):
        return jax.lax.scan(step, networks, length=workload.minibatches)[0]

    return compiled(one_pass, networks)


def random_observations(count):
    """A (count, 11) batch."""
    return jax.random.normal(jax.random.key(0), (count, OBSERVATIONS))


def random_networks(hidden_sizes):
    """Weights of a policy and a value network, all different: equal ones would be used once."""
    keys = iter(jax.random.split(jax.random.key(1), 2 * len(hidden_sizes) + 2))
    return [
        [
            jax.random.normal(next(keys), (rows, columns)) / rows**0.5
            for rows, columns in zip((OBSERVATIONS, *hidden_sizes), (*hidden_sizes, outputs))
        ]
        for outputs in (ACTIONS, 1)
    ]


def forward(weights, x):
    """The input and the output of every layer."""
    layers = [x]
    for matrix in weights:
        layers.append(layers[-1] @ matrix)
    return layers


def descend(weights, x):
    """Gradient descent on half the squared output; the input needs no gradient."""
    layers = forward(weights, x)
    gradient, updated = layers[-1], []
    for index in reversed(range(len(weights))):
        updated.insert(0, weights[index] - RATE / len(x) * (layers[index].T @ gradient))
        if index > 0:
            gradient = gradient @ weights[index].T
    return updated


def compiled(function, start):
    """The function compiled, to be called without arguments; it goes on from its last result."""
    program = jax.jit(function, donate_argnums=0).lower(start).compile()
    state = start

    def run():
        nonlocal state
        state = jax.block_until_ready(program(state))

    return run
