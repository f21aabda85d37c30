"""rejax's PPO as a contender; training.py runs this file in an environment that has rejax."""

import dataclasses

import jax
import rejax
from contenders import Workload, serve
from gymnax.environments import spaces

from attjax import AttitudeEnv
from attjax.presets import PAPER_FAST


@dataclasses.dataclass(frozen=True)
class FiveValueEnv:
    """The environment with gymnax's older ``step``, which returns one ``done``."""

    env: AttitudeEnv

    @property
    def default_params(self):
        """As the environment's."""
        return self.env.default_params

    def reset(self, key, params):
        """As the environment's."""
        return self.env.reset(key, params)

    def step(self, key, state, action, params):
        """Observation, state, scaled reward, done, no info."""
        observation, state, reward, terminated, truncated, _ = self.env.step(
            key, state, action, params
        )
        return observation, state, reward * PAPER_FAST.reward_scale, terminated | truncated, {}

    def observation_space(self, params):
        """As the environment's."""
        return self.env.observation_space(params)

    def action_space(self, params):
        """Of the class that rejax asks for."""
        return spaces.Discrete(self.env.num_actions)


def prepare(workload: Workload):
    """A function that runs one update."""
    algorithm = rejax.PPO.create(
        env=FiveValueEnv(AttitudeEnv(frameskip=20)),
        num_envs=workload.num_envs,
        num_steps=workload.rollout_length,
        num_epochs=workload.passes,
        num_minibatches=workload.minibatches,
        learning_rate=PAPER_FAST.learning_rate,
        gamma=PAPER_FAST.discount,
        gae_lambda=PAPER_FAST.gae_lambda,
        clip_eps=PAPER_FAST.clip,
        ent_coef=PAPER_FAST.entropy_coefficient,
        max_grad_norm=PAPER_FAST.max_gradient_norm,
        agent_kwargs={"hidden_layer_sizes": workload.hidden_sizes, "activation": "relu"},
    )
    state = jax.jit(algorithm.init_state)(jax.random.key(0))
    compiled = jax.jit(algorithm.train_iteration, donate_argnums=0).lower(state).compile()

    def update():
        nonlocal state
        state = jax.block_until_ready(compiled(state))

    return update


if __name__ == "__main__":
    serve(("rejax", "jax", "flax"), prepare)
