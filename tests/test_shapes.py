"""Wrong calls that give numbers, and are refused where signatures are checked: under the tests."""

import inspect
import re
import sys

import array_checks
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from commands import ROOT

from attjax import AttitudeEnv, dynamics
from attjax.control import features
from attjax.dynamics import numerics, quaternion, rigid_body
from attjax.envs.reward import Transition, paper_reward, scalar_part_increased
from attjax.ppo import losses

GOAL, REST, MOMENTS = jnp.array([0.0, 0.0, 0.0, 1.0]), jnp.zeros(3), jnp.array([0.4, 0.5, 0.6])
AT_REST = Transition(GOAL, GOAL, REST, False, False, 0.00436, 0.0875, REST)
ENV = AttitudeEnv(frameskip=5)
CONTEXT = ENV.context(ENV.default_params)


def advantages(rewards, discount):
    ended = jnp.zeros(rewards.shape, bool)
    return losses.generalized_advantages(rewards, rewards, rewards, ended, ended, discount, 0.9)


def shares(actions, samples):
    return jax.nn.log_softmax(jnp.zeros((actions, samples)), axis=0)


n, one, columns = jnp.ones(6), jnp.ones(1), jnp.ones((6, 1))
WRONG = {
    "a loss of one column": (losses.clipped_policy_loss, n, columns, n, 0.2),
    "a loss of one old probability": (losses.clipped_policy_loss, n, one, n, 0.2),
    "a loss of one advantage": (losses.clipped_policy_loss, n, n, one, 0.2),
    "one action for all samples": (losses.pick, shares(3, 6), jnp.array([2])),
    "actions that are no integers": (losses.pick, shares(3, 6), n),
    "a column of actions": (losses.pick, shares(3, 6), jnp.array([[0], [1], [2]])),
    "a discount of each time": (advantages, columns, n),
    "a sum of n and a column": (numerics.add, (n, n), columns),
    "a 3-vector for a quaternion": (quaternion.normalize, GOAL[1:]),
    "an angle of each axis": (quaternion.from_axis_angle, GOAL[1:], REST),
    "quaternions without a scalar part": (scalar_part_increased, REST, GOAL[1:]),
    "rates as a column": (rigid_body.angular_momentum, MOMENTS, REST[:, None]),
    "a torque along each axis": (dynamics.rate_after_impulse, REST, REST[:, None], MOMENTS),
    "ends of a batch": (paper_reward, AT_REST._replace(truncated=jnp.zeros(6, bool))),
}
RIGHT = {
    "losses": (losses.clipped_policy_loss, n, np.ones(6), n, 0.2),
    "a clip range that is an int": (losses.clipped_policy_loss, n, n, n, 1),
    "actions": (losses.pick, shares(3, 6), np.array([0, 1, 2, 2, 1, 0])),
    "one discount": (advantages, jnp.ones((5, 6)), 0.99),
    "a discount of each spacecraft": (advantages, jnp.ones((5, 6)), n),
    "sums": (numerics.add, (columns, columns), columns),
    "an axis of NumPy, an angle of Python": (quaternion.from_axis_angle, np.eye(3)[0], 1),
    "components one by one": (quaternion.derivative, (0.0, 0.0, 0.0, 1.0), [0, 0, 1]),
    "components of a batch": (quaternion.derivative, jnp.ones((4, 6)), jnp.ones((3, 6))),
    "moments": (rigid_body.angular_momentum, MOMENTS, jnp.ones((2, 6, 3))),
    "a tensor": (rigid_body.angular_momentum, jnp.diag(MOMENTS), REST),
    "torques": (dynamics.rate_after_impulse, REST, np.ones((6, 3), np.float32), MOMENTS),
    "a step of an array": (dynamics.rk4_step, GOAL, REST, REST, MOMENTS, jnp.array(0.01)),
    "steps after": (dynamics.propagate, GOAL, REST, REST, MOMENTS, 5, np.int32(3)),
    "a transition of Python's numbers": (paper_reward, AT_REST),
    "features": (features.multiscale_features, jnp.ones(11), CONTEXT),
}


@pytest.mark.parametrize("call", WRONG.values(), ids=WRONG)
def test_wrong_calls_are_refused(call):
    function, *arguments = call
    with pytest.raises(jaxtyping.TypeCheckError):
        function(*arguments)


@pytest.mark.parametrize("call", WRONG.values(), ids=WRONG)
def test_which_pass_without_a_check(as_users_run, call):
    """So the check is worth its while; a call that fails by itself belongs to test_checks.py."""
    function, *arguments = call
    for x in jax.tree.leaves(function(*arguments)):
        assert np.all(np.isfinite(x))


@pytest.mark.parametrize("call", RIGHT.values(), ids=RIGHT)
def test_right_calls_pass(call):
    function, *arguments = call
    for x in jax.tree.leaves(function(*arguments)):
        assert np.all(np.isfinite(x))


def test_float64_passes(x64):
    assert quaternion.normalize(jnp.array([0.0, 0.0, 3.0, 4.0])).dtype == jnp.float64


def test_tracers_are_checked_as_what_they_stand_for():
    """Within vmap, the shape of one; and gradients."""
    batch = jnp.stack([GOAL] * 6)
    assert jax.jit(jax.vmap(quaternion.error_angle))(batch).shape == (6,)
    assert jax.grad(quaternion.error_angle)(GOAL).shape == (4,)
    for mapped in (jax.vmap(quaternion.normalize, 1), jax.vmap(jax.jit(quaternion.normalize), 1)):
        with pytest.raises(jaxtyping.TypeCheckError):
            mapped(batch)


@pytest.mark.parametrize("name", array_checks.MODULES)
def test_every_module_is_checked(name):
    module = sys.modules[name]
    own = {k: v for k, v in vars(module).items() if inspect.isfunction(v) and v.__module__ == name}
    public = {k for k in own if not k.startswith("_")}
    assert public and all(hasattr(own[k], "__wrapped__") for k in public), public
    assert "annotations" not in vars(module), "from __future__ import annotations hides the shapes"


def test_they_are_those_of_the_decision():
    text = (ROOT / "docs/decisions/array-checks.md").read_text()
    (line,) = re.findall(r"^\*\*Modules\.\*\* (.+?)\n\n", text, re.MULTILINE | re.DOTALL)
    told = re.findall(r"`(\w+/\w+)`", line)
    assert sorted(f"attjax.{x.replace('/', '.')}" for x in told) == sorted(array_checks.MODULES)
