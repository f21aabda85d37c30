"""attjax's programs, lowered for a device that need not be there."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp

from attjax import AttitudeEnv, sharding
from attjax.config.presets import PRESETS
from attjax.envs import batch
from attjax.evaluation import blocks, episodes
from attjax.ppo import descent, train, train_state
from attjax.ppo.rollout import rollout
from attjax.runs import build
from attjax.sharding import SHARED

AGENT_STEPS = 64
"""Of each spacecraft in the simulator's program."""


def programs(preset: str, slews: int) -> list[tuple[str, int, Callable[[], jax.stages.Lowered]]]:
    """What each program does, how many of it, and a function that lowers it.

    Args:
        preset: whose spacecraft, networks, rollouts and gradient steps they have.
        slews: of the evaluation.
    """
    setup = build.setup(PRESETS[preset])
    settings, params, key = setup.settings.ppo, build.env_params(setup), jax.random.key(0)
    learner = jax.eval_shape(functools.partial(train_state.init.__wrapped__, setup), params, key)
    env = AttitudeEnv(min(setup.settings.task.frameskips))
    limit = int(env.default_params.max_steps_in_episode)
    return [
        (
            "agent step of the simulator",
            AGENT_STEPS,
            lambda: simulator(AttitudeEnv(max(setup.settings.task.frameskips)), settings.num_envs),
        ),
        (
            "agent step of a rollout",
            settings.rollout_length,
            lambda: _on_device(functools.partial(rollout, setup), params, learner),
        ),
        (
            "gradient step",
            settings.passes * settings.minibatches,
            lambda: gradient_steps(setup, params, learner),
        ),
        ("update", 1, lambda: train.train_block.lower(setup, params, learner, 1)),
        (
            "agent step of an evaluation",
            limit,
            lambda: evaluation(env, setup.policy, learner.params, slews),
        ),
    ]


def simulator(env: AttitudeEnv, num_envs: int) -> jax.stages.Lowered:
    """The fused rollout with random actions."""
    key = jax.random.key(0)
    _, states = jax.eval_shape(
        lambda key: episodes.random_slews(env, env.default_params, key, num_envs), key
    )
    actions = jax.ShapeDtypeStruct((AGENT_STEPS, num_envs), jnp.int32)
    return batch.open_loop.lower(env, env.default_params, key, states, actions)


def gradient_steps(setup: train_state.Setup, params, learner) -> jax.stages.Lowered:
    """All passes of an update."""

    def sampled(params, learner):
        learner, steps = rollout(setup, params, learner)
        return train.with_advantages(setup, params, learner, steps)

    def learn(samples, learner):
        return descent.optimize(setup.policy, setup.settings.ppo, learner, samples, 1)

    samples = jax.eval_shape(
        sharding.on_devices(1, sampled, (SHARED, SHARED), SHARED), params, learner
    )
    return _on_device(learn, samples, learner)


def evaluation(env: AttitudeEnv, policy, params, slews: int) -> jax.stages.Lowered:
    """Random slews under the greedy policy, to their end."""
    controller = jax.tree_util.Partial(policy.act, params)
    keys = jax.random.split(jax.random.key(0), (1, slews))

    def fly(controller, keys):
        # Not by its own jit: of parameters that are constants, the number of steps is known.
        return blocks.fly_blocks.__wrapped__(controller, env, env.default_params, keys)

    return jax.jit(fly).lower(controller, keys)


def _on_device(function, *arguments):
    on_device = sharding.on_devices(1, function, (SHARED,) * len(arguments), SHARED)
    return jax.jit(on_device).lower(*arguments)
