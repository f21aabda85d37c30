"""Stable-Baselines3's PPO as a contender; training.py runs this file where it is installed."""

import functools
import os

import gymnasium
import torch
from contenders import Workload, serve
from stable_baselines3 import PPO

import attjax.wrappers.gymnasium
from attjax.config.presets import PAPER_FAST
from attjax.wrappers.sb3 import as_vec_env


def environment(num_envs: int):
    """Our environment, all spacecraft in one jitted call, as SB3's kind of vector.

    The time limit counts as an end, as in the paper, which also spares SB3 a call of the value
    network for each.
    """
    vector_env = gymnasium.make_vec(attjax.wrappers.gymnasium.ID, num_envs=num_envs)
    return as_vec_env(vector_env, PAPER_FAST.task.reward_scale, time_limit_terminates=True)


def prepare(algorithm, relu, workload: Workload):
    """A function that runs one update of an algorithm of Stable-Baselines3's kind."""
    sizes = list(workload.hidden_sizes)
    model = algorithm(
        "MlpPolicy",
        environment(workload.num_envs),
        learning_rate=PAPER_FAST.ppo.learning_rate,
        n_steps=workload.rollout_length,
        batch_size=workload.minibatch_size,
        n_epochs=workload.passes,
        gamma=PAPER_FAST.ppo.discount,
        gae_lambda=PAPER_FAST.ppo.gae_lambda,
        clip_range=PAPER_FAST.ppo.clip,
        ent_coef=PAPER_FAST.ppo.entropy_coefficient,
        max_grad_norm=PAPER_FAST.ppo.max_gradient_norm,
        policy_kwargs={"net_arch": {"pi": sizes, "vf": sizes}, "activation_fn": relu},
        device="cpu",
    )

    def update():
        model.learn(workload.steps, reset_num_timesteps=False)

    return update


if __name__ == "__main__":
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    serve(("stable-baselines3", "torch"), functools.partial(prepare, PPO, torch.nn.ReLU))
