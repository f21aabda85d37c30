"""SBX's PPO as a contender; training.py runs this file in an environment that has SBX."""

import functools

import flax.linen as nn
from contenders import serve
from sb3_runner import prepare
from sbx import PPO

if __name__ == "__main__":
    serve(("sbx-rl", "jax", "flax"), functools.partial(prepare, PPO, nn.relu))
