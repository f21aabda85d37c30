"""rejax's PPO as a contender; training.py runs this file in an environment that has rejax."""

import jax
import rejax
from contenders import Workload, serve

from attjax import AttitudeEnv
from attjax.config.presets import PAPER_FAST
from attjax.wrappers.gymnax import FiveValueEnv


def prepare(workload: Workload):
    """A function that runs one update."""
    algorithm = rejax.PPO.create(
        env=FiveValueEnv(AttitudeEnv(frameskip=20), PAPER_FAST.task.reward_scale),
        num_envs=workload.num_envs,
        num_steps=workload.rollout_length,
        num_epochs=workload.passes,
        num_minibatches=workload.minibatches,
        learning_rate=PAPER_FAST.ppo.learning_rate,
        gamma=PAPER_FAST.ppo.discount,
        gae_lambda=PAPER_FAST.ppo.gae_lambda,
        clip_eps=PAPER_FAST.ppo.clip,
        ent_coef=PAPER_FAST.ppo.entropy_coefficient,
        max_grad_norm=PAPER_FAST.ppo.max_gradient_norm,
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
