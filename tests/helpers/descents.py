"""An update's gradient steps for tests: small setups, random samples, and a run of them."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import PartitionSpec
from setups import small_attitude_setup

from attjax import sharding
from attjax.ppo import descent, train_state
from attjax.ppo.networks import Inputs

ACTIONS = 19


def small_setup(num_devices=1, **overrides):
    """8 spacecraft that make 128 samples."""
    sizes = {"num_envs": 8, "rollout_length": 16, "minibatch_size": 32, "hidden_sizes": (4,)}
    overrides = sizes | {"frameskips": (20,), "features": "state", "rate_margin": 0.0} | overrides
    setup = small_attitude_setup(3, **overrides)
    return dataclasses.replace(setup, num_devices=num_devices)


def random_samples(count):
    rng = np.random.default_rng(0)
    return descent.Sample(
        inputs=Inputs(jnp.array(rng.normal(size=(count, 11)), float), jnp.ones((count, 19), bool)),
        action=jnp.array(rng.integers(0, ACTIONS, count)),
        log_probability=jnp.array(rng.normal(-3, 0.3, count), float),
        advantage=jnp.array(rng.normal(0.7, 2, count), float),
        target=jnp.array(rng.normal(1, 1, count), float),
    )


def new_learner(setup, update=0):
    """With random parameters; no gradient step looks at its spacecraft."""
    rng = np.random.default_rng(1)

    def network(outputs):
        shapes = {"Dense_0": (11, 4), "Dense_1": (4, outputs)}
        return {
            "params": {
                name: {
                    "kernel": jnp.array(rng.normal(0, 0.3, shape), float),
                    "bias": jnp.array(rng.normal(0, 0.3, shape[1]), float),
                }
                for name, shape in shapes.items()
            }
        }

    params = {"policy": network(ACTIONS), "value": network(1)}
    adam = train_state.optimizer(setup.settings.ppo)
    none = jnp.zeros(setup.settings.ppo.num_envs)
    return train_state.Learner(
        params=params,
        optimizer={name: adam.init(network) for name, network in params.items()},
        states=none,
        observation=none,
        score=none,
        is_whole=none,
        key=jax.random.key(0),
        update=jnp.int32(update),
    )


def optimized(setup, samples, update=0):
    """The learner before, the one after and the metrics."""
    before = new_learner(setup, update)
    specs = (train_state.LEARNER_SPECS, sharding.SPLIT)
    run = sharding.on_devices(
        setup.num_devices,
        lambda before, samples: descent.optimize(
            setup.policy, setup.settings.ppo, before, samples, setup.num_devices
        ),
        specs,
        (train_state.LEARNER_SPECS, PartitionSpec()),
    )
    return before, *jax.jit(run)(before, samples)
