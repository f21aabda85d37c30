"""Stable-Baselines3's PPO as a contender; training.py runs this file where it is installed."""

import jax
import numpy as np
import torch
from contenders import Workload, serve
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv

from attjax import AttitudeEnv
from attjax.presets import PAPER_FAST


class BatchedEnv(VecEnv):
    """Our environment, all spacecraft in one jitted call, as SB3's kind of vector.

    The time limit counts as an end, as in the paper: no final observations are handed on,
    which also spares SB3 a call of the value network for each.
    """

    render_mode = None

    def __init__(self, num_envs: int):
        env = AttitudeEnv(frameskip=20)
        box = env.observation_space(env.default_params)
        low, high = np.asarray(box.low), np.asarray(box.high)
        super().__init__(num_envs, spaces.Box(low, high), spaces.Discrete(env.num_actions))
        self._infos = [{} for _ in range(num_envs)]
        self._key = jax.random.key(0)
        self._reset = jax.jit(jax.vmap(lambda key: env.reset(key, env.default_params)))
        self._step = jax.jit(self._batched_step(env), donate_argnums=1)

    def _batched_step(self, env):
        def step(key, states, actions):
            key, step_key = jax.random.split(key)
            keys = jax.random.split(step_key, self.num_envs)
            observation, states, reward, terminated, truncated, _ = jax.vmap(
                env.step, (0, 0, 0, None)
            )(keys, states, actions, env.default_params)
            return (
                key,
                states,
                (observation, reward * PAPER_FAST.reward_scale, terminated | truncated),
            )

        return step

    def reset(self):
        """Start all episodes; observations."""
        observation, self._states = self._reset(jax.random.split(self._key, self.num_envs))
        return np.asarray(observation)

    def step_async(self, actions):
        """Keep the actions for step_wait."""
        self._actions = actions

    def step_wait(self):
        """Observations, rewards, ends and empty infos."""
        self._key, self._states, results = self._step(self._key, self._states, self._actions)
        return (*map(np.asarray, results), self._infos)

    def close(self):
        """Nothing is open."""

    def get_attr(self, attr_name, indices=None):
        """The attribute, once for each environment."""
        return [getattr(self, attr_name)] * self.num_envs

    def set_attr(self, attr_name, value, indices=None):
        """Set the attribute, which all environments share."""
        setattr(self, attr_name, value)

    def env_method(self, method_name, *method_args, indices=None, **method_kwargs):
        """The method's result, once for each environment."""
        return [getattr(self, method_name)(*method_args, **method_kwargs)] * self.num_envs

    def env_is_wrapped(self, wrapper_class, indices=None):
        """No environment is."""
        return [False] * self.num_envs


def prepare(workload: Workload):
    """A function that runs one update."""
    model = PPO(
        "MlpPolicy",
        BatchedEnv(workload.num_envs),
        learning_rate=PAPER_FAST.learning_rate,
        n_steps=workload.rollout_length,
        batch_size=workload.minibatch_size,
        n_epochs=workload.passes,
        gamma=PAPER_FAST.discount,
        gae_lambda=PAPER_FAST.gae_lambda,
        clip_range=PAPER_FAST.clip,
        ent_coef=PAPER_FAST.entropy_coefficient,
        max_grad_norm=PAPER_FAST.max_gradient_norm,
        policy_kwargs={
            "net_arch": {"pi": list(workload.hidden_sizes), "vf": list(workload.hidden_sizes)},
            "activation_fn": torch.nn.ReLU,
        },
        device="cpu",
    )

    def update():
        model.learn(workload.steps, reset_num_timesteps=False)

    return update


if __name__ == "__main__":
    torch.set_num_threads(1)
    serve(("stable-baselines3", "torch"), prepare)
