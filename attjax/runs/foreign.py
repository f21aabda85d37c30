"""Policies of other learners, kept in a run folder as a run of PPO keeps its own.

Evaluation takes them as they are; ``train.py --resume`` cannot go on with them.
"""

import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import ArrayLike

from attjax.ppo.distributions import LEAST_STD
from attjax.ppo.train_state import Learner


def gaussian_params(layers: Sequence[tuple[ArrayLike, ArrayLike]], std: float) -> dict:
    """The parameters of a continuous policy whose mean is the action of a deterministic actor.

    Args:
        layers: of the actor, from inputs to outputs, ReLU between them: kernel (inputs, outputs)
            and bias (outputs,). The last has 3 outputs, whose tanh are fractions of the torques.
        std: standard deviation of the noise that it explored with, the same for each axis;
            above LEAST_STD and below 1.

    Example:
        >>> params = gaussian_params([(jnp.ones((11, 3)), jnp.zeros(3))], std=0.5)["params"]
        >>> params["Dense_0"]["kernel"].shape, params["Dense_0"]["bias"].shape
        ((11, 6), (6,))
    """
    *hidden, (kernel, bias) = [tuple(map(jnp.asarray, layer)) for layer in layers]
    widened = jnp.pad(kernel, ((0, 0), (0, 3)))
    share = std - LEAST_STD
    deviation = jnp.full_like(bias, math.log(share / (1 - share)))
    last = widened, jnp.concatenate([bias, deviation])
    return {
        "params": {
            f"Dense_{index}": {"kernel": kernel, "bias": bias}
            for index, (kernel, bias) in enumerate([*hidden, last])
        }
    }


def learner(params: dict, update: int) -> Learner:
    """What a checkpoint of such a policy is saved from: ``update`` names it, the rest is empty."""
    nothing: dict = {}
    return Learner(
        params={"policy": params},
        optimizer=nothing,
        states=nothing,
        observation=jnp.zeros(1),
        score=jnp.zeros(1),
        is_whole=jnp.zeros(1, bool),
        key=jax.random.key(0),
        update=jnp.asarray(update, jnp.int32),
    )
