"""PureJaxRL's own ppo.py as a contender; training.py runs this file where its packages are.

The only argument is the folder with its ppo.py and wrappers.py, which stay as they are: the task
is registered with gymnax, and one call of what ``make_train`` returns is one update, with fresh
networks and environments before it. Its networks are 64-64, whatever the workload says.
"""

import contextlib
import functools
import importlib
import sys

import gymnax
import jax
from contenders import Workload, serve

from attjax import AttitudeEnv
from attjax.config.presets import PAPER_FAST
from attjax.wrappers.gymnax import FiveValueEnv

NAME = "AttjaxSlew"
CONFIG = {
    "ENV_NAME": NAME,
    "ACTIVATION": "relu",
    "ANNEAL_LR": False,
    "LR": PAPER_FAST.ppo.learning_rate,
    "GAMMA": PAPER_FAST.ppo.discount,
    "GAE_LAMBDA": PAPER_FAST.ppo.gae_lambda,
    "CLIP_EPS": PAPER_FAST.ppo.clip,
    "ENT_COEF": PAPER_FAST.ppo.entropy_coefficient,
    "VF_COEF": 0.5,
    "MAX_GRAD_NORM": PAPER_FAST.ppo.max_gradient_norm,
}


def prepare(ppo, workload: Workload):
    """A function that runs one update."""
    sizes = {
        "NUM_ENVS": workload.num_envs,
        "NUM_STEPS": workload.rollout_length,
        "TOTAL_TIMESTEPS": workload.steps,
        "UPDATE_EPOCHS": workload.passes,
        "NUM_MINIBATCHES": workload.minibatches,
    }
    key = jax.random.key(0)
    compiled = jax.jit(ppo.make_train(CONFIG | sizes)).lower(key).compile()

    def update():
        jax.block_until_ready(compiled(key))

    return update


if __name__ == "__main__":
    sys.path.insert(0, sys.argv[1])
    env = AttitudeEnv(frameskip=20)
    scale = PAPER_FAST.task.reward_scale
    gymnax.register(NAME, functools.partial(FiveValueEnv, env, scale))
    with contextlib.redirect_stdout(sys.stderr):  # what it imports prints, too
        ppo = importlib.import_module("ppo")
    serve(("gymnax", "jax"), functools.partial(prepare, ppo))
