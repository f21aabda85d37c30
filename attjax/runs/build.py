"""From settings to the objects that they describe."""

import functools
import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from attjax.config import user_functions
from attjax.config.run import Config
from attjax.config.settings import Settings, Task
from attjax.control import assurance, torque_order
from attjax.control.features import FEATURES
from attjax.control.looped import LoopedEnv
from attjax.envs import fleet, initial_state, parameters
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.reward import REWARDS
from attjax.errors import UserValueError
from attjax.ppo import train_state
from attjax.ppo.networks import Policy
from attjax.spacecraft import LM50, Spacecraft
from attjax.world import IDEAL, World

MAX_DEVICES = 8
"""Most devices of a run, a power of two as their number is."""

FLEET_UPDATES = 32
"""Updates for which the same spacecraft train, where any do."""

MIN_SAMPLES = 512
"""Samples of a minibatch on a device below which sharing it out costs more than it gains."""


def policy(settings: Settings, craft: Spacecraft = LM50) -> Policy:
    """The policy for a spacecraft, without parameters.

    Raises:
        FunctionError: the features are a user's function that cannot be used.
        UserValueError: they are universal, and the actions or the spacecraft not as they need it.
    """
    name = settings.network.features
    features: str | Callable = name
    if settings.network.is_universal:
        if settings.task.actions != "discrete":
            raise UserValueError("universal features are for discrete actions, not continuous ones")
        try:
            torque_order.check_axes(craft)
        except ValueError as error:
            raise UserValueError(str(error)) from None
    if name not in FEATURES:
        features = user_functions.resolve(name)
        call = functools.partial(jax.eval_shape, features, *_first_sight(craft))
        user_functions.check(f"features {name}", call, rank=1)
    network = settings.network
    return Policy(
        features,
        network.hidden_sizes,
        torque_order.ACTIONS if settings.network.is_universal else craft.num_actions,
        network.rate_margin,
        network.initial_weights,
        settings.task.actions,
    )


def rules(task: Task) -> dict[str, Any]:
    """What a run's settings say of the motion, the actions and what is observed, for AttitudeEnv.

    A run is judged by the rules that it was trained by, whatever its reward and its starts.
    """
    names = "kinematic_factor", "observes_quaternion_rate", "actions"
    return {name: getattr(task, name) for name in names}


def environment(frameskip: int, craft: Spacecraft, given: dict[str, Any]) -> AttitudeEnv:
    """The simulator, with other fields by name: rules, and the world.

    Raises:
        UserValueError: actions are continuous, and a torque of the spacecraft along no body axis.
    """
    try:
        return AttitudeEnv(frameskip, spacecraft=craft, **given)
    except ValueError as error:
        raise UserValueError(f"{craft}: {error}") from None


def setup(
    settings: Settings, craft: Spacecraft = LM50, num_devices: int = 1, world: World = IDEAL
) -> train_state.Setup:
    """Environment, policy and settings of a training run.

    Raises:
        FunctionError: the reward or the features are a user's function that cannot be used.
        UserValueError: the rate mask leaves no torque, even at rest, the fleet's episodes are not
            those of the spacecraft, or as :func:`environment` and :func:`policy`.
    """
    if settings.task.any_spacecraft:
        _check_fleet(settings, craft)
    elif settings.task.crippled_share > 0:
        raise UserValueError("crippled_share is for any_spacecraft")
    reward = REWARDS.get(settings.task.reward) or user_functions.resolve(settings.task.reward)
    start = initial_state.initial_state
    if settings.task.near_goal_share > 0:
        start = initial_state.NearGoalStarts(
            settings.task.near_goal_share, settings.task.near_goal_steps
        )
    frameskip = max(settings.task.frameskips)
    given = {"reward": reward, "initial_state": start, "world": world, **rules(settings.task)}
    env: Any = environment(frameskip, craft, given)
    if settings.task.reward not in REWARDS:
        first_reward = functools.partial(_first_reward, env)
        user_functions.check(
            f"reward {settings.task.reward}", lambda: jax.eval_shape(first_reward), rank=0
        )
    if settings.network.rate_margin > 0 and settings.task.actions == "discrete":
        _check_that_torques_are_left(settings, craft)
    if settings.task.in_flight_loop and not world.is_ideal:
        env = LoopedEnv(env)
    groups = len(settings.task.frameskips)
    return train_state.Setup(env, policy(settings, craft), settings, groups, num_devices)


def of_config(config: Config) -> train_state.Setup:
    """The same of a run's configuration, on as many devices as it is worth.

    Raises:
        FunctionError, UserValueError: as :func:`setup`.
    """
    devices = num_devices(config.settings)
    return setup(config.settings, config.spacecraft, devices, config.world)


def _check_fleet(settings, craft):
    """Spacecraft of a fleet have the paper's kind of actions, and nothing else is wrong."""
    if settings.task.actions != "discrete":
        raise UserValueError(f"any_spacecraft is for discrete actions, not {settings.task.actions}")
    if craft.num_actions != LM50.num_actions or craft.torque_held:
        kind = "held torques" if craft.torque_held else f"{craft.num_actions} actions"
        raise UserValueError(
            f"any_spacecraft draws spacecraft with {LM50.num_actions} actions, pulses; {craft}, "
            f"whose episodes they fly, has {kind}"
        )


def _check_that_torques_are_left(settings, craft):
    for frameskip in settings.task.frameskips:
        env = AttitudeEnv(frameskip, spacecraft=craft)
        mask = assurance.rate_mask(env.context(env.default_params), settings.network.rate_margin)
        if np.sum(mask.allowed(jnp.zeros(3))) <= 1:
            raise UserValueError(
                f"rate_margin {settings.network.rate_margin:g} masks every torque of {craft} with "
                f"frameskip {frameskip}, even at rest; weaker torque_levels, smaller frameskips or "
                f"a larger rate_limit leave some, and rate_margin 0 masks nothing"
            )


def _first_reward(env):
    params, key = env.default_params, jax.random.key(0)
    none = jnp.zeros(env.action_space(params).shape, env.action_space(params).dtype)
    return env.step_env(key, env.reset(key, params)[1], none, params)[2]


def _first_sight(craft):
    """An observation and a context of a spacecraft, as features have them."""
    env = AttitudeEnv(0, spacecraft=craft)
    params = env.default_params
    return env.reset(jax.random.key(0), params)[0], env.context(params)


def num_devices(settings: Settings) -> int:
    """How many of the devices that there are a training run shares its work out to.

    Each has a spacecraft of each control rate, at least.
    """
    shared = math.gcd(settings.ppo.num_envs, settings.ppo.minibatch_size, MAX_DEVICES)
    most = min(
        len(jax.devices()),
        max(1, settings.ppo.minibatch_size // MIN_SAMPLES),
        settings.ppo.num_envs // len(settings.task.frameskips),
    )
    return max(n for n in range(1, shared + 1) if shared % n == 0 and n <= most)


def env_params(setup: train_state.Setup, seed: int = 0, update: int = 0) -> parameters.EnvParams:
    """The spacecraft's parameters in an update, but for the cap on the episode's length.

    Where actions are continuous, nothing masks them, and the rate limit is the margin of it that
    the mask would keep: a policy that learns to stay below it has room for its errors. With
    several control rates, each group of spacecraft has its own. Where any spacecraft train, the
    seed draws others for every FLEET_UPDATES updates.
    """
    settings, params = setup.settings, setup.env.default_params
    craft, margin = setup.env.spacecraft, settings.network.rate_margin
    if margin > 0 and settings.task.actions == "continuous":
        params = params.replace(rate_limit=margin * params.rate_limit)
    if settings.task.any_spacecraft:
        params = params.replace(**_fleet(setup, seed, update // FLEET_UPDATES))
    longest = [craft.max_steps(frameskip) for frameskip in settings.task.frameskips]
    limits = np.minimum(longest, settings.task.max_episode_steps).astype(np.int32)
    if setup.groups == 1:
        return params.replace(max_steps_in_episode=jnp.asarray(limits[0]))
    frameskips = np.array(settings.task.frameskips, np.int32)
    return params.replace(
        max_steps_in_episode=jnp.asarray(limits[setup.group_of_row]),
        frameskip=jnp.asarray(frameskips[setup.group_of_row]),
    )


def _fleet(setup, seed, number):
    """The fleet of that number of a run, by the names of its parameters."""
    frameskips = np.array(setup.settings.task.frameskips)[setup.group_of_row]
    random = np.random.default_rng([seed, number])
    drawn = fleet.draw(random, frameskips)
    drawn = fleet.with_faults(random, drawn, frameskips, setup.settings.task.crippled_share)
    if not setup.env.world.is_ideal:  # which has disturbances of its own
        drawn = drawn._replace(disturbance=None)
    return drawn.parameters()


def initial_parameters(policy: Policy, craft: Spacecraft = LM50) -> dict:
    """Parameters of the right shapes for a policy that flies the spacecraft."""
    return policy.init(jax.random.key(0), jax.random.key(1), *_first_sight(craft))
