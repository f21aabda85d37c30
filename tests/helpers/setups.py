"""Small training setups that several test files share."""

import functools

from jax.sharding import PartitionSpec

from attjax import sharding
from attjax.config import presets
from attjax.config.run import Config
from attjax.ppo import train_state
from attjax.ppo.rollout import rollout
from attjax.runs import build

SMALL = {
    "num_envs": 64,
    "rollout_length": 16,
    "minibatch_size": 128,
    "hidden_sizes": (32, 32),
    "reward_scale": 1.0,
    "learning_rate": 3e-3,
    "final_learning_rate": 3e-4,
    "updates_per_block": 1,
}

PLAIN = presets.PAPER_FAST.replace(
    gae_lambda=0.95,
    passes=4,
    greedy_share=0.0,
    near_goal_share=0.0,
    rate_margin=0.0,
    time_limit_terminates=True,
)
"""PPO without what helps on slews."""

SETTINGS = presets.PRECISE.replace(
    frameskips=(5, 20),
    num_envs=8,
    rollout_length=4,
    minibatch_size=8,
    hidden_sizes=(8,),
    total_steps=8 * 4 * 4,
)
CONFIG = Config("precise", 3, SETTINGS)


def settings(updates, preset=PLAIN, **overrides):
    values = SMALL | overrides
    steps = values["num_envs"] * values["rollout_length"] * updates
    return preset.replace(total_steps=steps, **values)


def small_attitude_setup(updates, preset=presets.PRECISE, **overrides):
    overrides = {"frameskips": (5, 20)} | overrides
    return build.setup(settings(updates, preset, **overrides))


def fly(setup, env_params, state):
    """The learner and the steps of one rollout."""
    on_device = functools.partial(rollout, setup, env_params)
    out_specs = (train_state.LEARNER_SPECS, PartitionSpec(None, sharding.AXIS))
    in_specs = (train_state.LEARNER_SPECS,)
    return sharding.on_devices(setup.num_devices, on_device, in_specs, out_specs)(state)
