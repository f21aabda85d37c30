"""From settings to the objects that they describe."""

import math

import jax
import jax.numpy as jnp
import numpy as np

from attjax import learner, spacecraft
from attjax.env import AttitudeEnv
from attjax.networks import Policy
from attjax.reward import REWARDS
from attjax.settings import Settings

MAX_DEVICES = 8
"""Most devices of a run, a power of two as their number is."""

MIN_SAMPLES = 512
"""Samples of a minibatch on a device below which sharing it out costs more than it gains."""


def policy(settings: Settings) -> Policy:
    """The policy, without parameters."""
    return Policy(
        features=settings.features,
        hidden_sizes=settings.hidden_sizes,
        rate_margin=settings.rate_margin,
    )


def setup(settings: Settings, num_devices: int = 1) -> learner.Setup:
    """Environment, policy and settings of a training run."""
    reward = REWARDS[settings.reward]
    start = spacecraft.initial_state
    if settings.near_goal_share > 0:
        start = spacecraft.NearGoalStarts(settings.near_goal_share, settings.near_goal_steps)
    env = AttitudeEnv(max(settings.frameskips), reward, start)
    groups = len(settings.frameskips)
    return learner.Setup(env, policy(settings), settings, groups, num_devices)


def num_devices(settings: Settings) -> int:
    """How many of the devices that there are a training run shares its work out to."""
    shared = math.gcd(settings.num_envs, settings.minibatch_size, MAX_DEVICES)
    most = min(len(jax.devices()), max(1, settings.minibatch_size // MIN_SAMPLES))
    return max(n for n in range(1, shared + 1) if shared % n == 0 and n <= most)


def env_params(setup: learner.Setup) -> spacecraft.EnvParams:
    """The paper's parameters, but for the cap on the episode's length.

    With several control rates, each group of spacecraft has its own.
    """
    settings, params = setup.settings, setup.env.default_params
    limits = [spacecraft.max_steps(frameskip) for frameskip in settings.frameskips]
    limits = np.minimum(limits, settings.max_episode_steps).astype(np.int32)
    if setup.groups == 1:
        return params.replace(max_steps_in_episode=jnp.asarray(limits[0]))
    frameskips = np.array(settings.frameskips, np.int32)
    return params.replace(
        max_steps_in_episode=jnp.asarray(limits[setup.group_of_row]),
        frameskip=jnp.asarray(frameskips[setup.group_of_row]),
    )


def initial_parameters(policy: Policy) -> dict:
    """Parameters of the right shapes for a policy on the attitude environment."""
    env = AttitudeEnv()
    params = env.default_params
    observation, _ = env.reset(jax.random.key(0), params)
    return policy.init(jax.random.key(0), jax.random.key(1), observation, env.context(params))
