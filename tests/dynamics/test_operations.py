"""How much there is to compile: operations of an agent step as it is handed to the compiler.

Not seconds, which differ from machine to machine. RK4 steps written out one by one would show here,
and so would those in a reducer itself, whose walk takes exponentially long (see fused_loop).
"""

import re

import jax
import jax.numpy as jnp
import pytest

from attjax.dynamics import propagation
from attjax.dynamics.integration import AgentStep

MOST = 1_600
"""Of a full tensor and several control rates; of the paper's spacecraft it is half of that."""

MOST_IN_A_REDUCER = 9
"""One call, what says which copy it is of, and the end; that copy's choice is calls, too."""


def lowered(platform, frameskip, held, is_tensor, dtype):
    inertia = jnp.diag(jnp.ones(3, dtype)) if is_tensor else jnp.ones(3, dtype)
    agent_step = AgentStep(frameskip, held)

    def take(quaternion, angular_velocity, torque, steps_after):
        moving = quaternion, angular_velocity, torque, inertia
        return propagation.take(agent_step, *moving, steps_after)

    batch = [jax.ShapeDtypeStruct((8, n), dtype) for n in (4, 3, 3)]
    after = jax.ShapeDtypeStruct((8,), dtype)
    return jax.jit(jax.vmap(take)).trace(*batch, after).lower(lowering_platforms=(platform,))


def operations(text):
    """But for the choices between two numbers."""
    return re.findall(
        r"(?:= \"?|^ *)(stablehlo\.\w+|func\.call|call) (?!@_where)", text, re.MULTILINE
    )


def reducers(text):
    """The bodies of its reductions that are not one of the compiler's own operations."""
    return [part[part.index("{") : part.index("}")] for part in text.split("reducer(")[1:]]


@pytest.mark.parametrize("platform", ["cpu", "cuda"])
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("is_tensor", [False, True])
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.float64])
def test_however_long_an_agent_step_is_there_is_no_more_to_compile(
    platform, held, is_tensor, dtype
):
    with jax.enable_x64(dtype == jnp.float64):
        for frameskip in (0, 5, 20, 64, 10_499):
            text = lowered(platform, frameskip, held, is_tensor, dtype).as_text()
            assert len(operations(text)) <= MOST, frameskip
            assert reducers(text)
            for body in reducers(text):
                assert len(operations(body)) <= MOST_IN_A_REDUCER, body
