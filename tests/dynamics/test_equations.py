"""The equations of motion by name: no order is relied on, and there is room for more of them."""

import collections
import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from bodies import LM50, random_spacecraft, rotated_inertia
from scipy.integrate import solve_ivp

from attjax import dynamics
from attjax.dynamics import equations, integration, propagation, quaternion
from attjax.dynamics.fused_loop import one_kernel, one_loop

pytestmark = pytest.mark.usefixtures("strict_promotion")
BODIES = pytest.mark.parametrize("inertia", [LM50, rotated_inertia()], ids=["diagonal", "full"])
FORMS = ("RigidState", "EquationsOfMotion", "PrincipalTerms", "TensorTerms")


def reordered(form):
    """A named tuple with the same fields and methods in the opposite order."""
    fields = form._fields[::-1]
    defaults = [form._field_defaults.get(x) for x in fields]  # after one's, all's
    backwards = collections.namedtuple(form.__name__, fields, defaults=defaults)
    public = {x: y for x, y in vars(form).items() if x[0] != "_" and x not in form._fields}
    return type(form.__name__, (backwards,), public)


@BODIES
@pytest.mark.parametrize("held, steps_after", [(False, None), (True, 3)])
def test_the_order_of_the_fields_changes_nothing(monkeypatch, inertia, held, steps_after):
    arguments = random_spacecraft(9)

    def fly():
        def agent_step(q, w, torque):
            return dynamics.propagate(q, w, torque, jnp.asarray(inertia), 5, steps_after, held)

        return *jax.jit(jax.vmap(agent_step))(*arguments), *jax.jacfwd(agent_step)(
            *(x[0] for x in arguments)
        )

    expected = fly()
    for name in FORMS:
        backwards = reordered(getattr(equations, name))
        for module in (equations, integration, propagation):
            if hasattr(module, name):
                monkeypatch.setattr(module, name, backwards)
    ours = fly()
    for a, b in zip(ours, expected):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-7)
    assert propagation.RigidState._fields == ("angular_velocity", "quaternion")


class WheelState(NamedTuple):
    momentum: jax.Array
    rigid: equations.RigidState


class WheelEquations(NamedTuple):
    """A wheel about the first body axis, whose motor is on for the first RK4 step or all."""

    body: equations.EquationsOfMotion
    moments: tuple
    motor: jax.Array | None

    steps_together = equations.EquationsOfMotion.steps_together
    is_timed = False
    during = equations.EquationsOfMotion.during
    after = equations.EquationsOfMotion.after

    def coasting(self):
        return self._replace(motor=None)

    def rate(self, state):
        rigid = self.body.rate(state.rigid)
        _, w2, w3 = state.rigid.angular_velocity
        motor = 0 * w2 if self.motor is None else self.motor
        i1, i2, i3 = self.moments
        h = state.momentum
        more = (-motor / i1, -w3 * h / i2, w2 * h / i3)
        velocity = equations.add(rigid.angular_velocity, more)
        return WheelState(momentum=motor, rigid=rigid._replace(angular_velocity=velocity))


@pytest.mark.parametrize("held", [False, True])
def test_a_state_that_holds_more_flows_through(x64, held):
    """A spacecraft with a wheel: I ω̇ = −ω × (Iω + h) − ḣ, against DOP853."""
    q, w, _ = (x[0] for x in random_spacecraft(1))
    motor, momentum, frameskip = 0.03, 0.2, 20
    inertia = np.diag(LM50)

    def rate(_, y, motor):
        v, qs, w = y[:3], y[3], y[4:7]
        h, torque = np.array([y[7], 0, 0]), np.array([motor, 0, 0])
        turning = np.linalg.solve(inertia, -np.cross(w, inertia @ w + h) - torque)
        return [*(qs * w + np.cross(v, w)) / 2, -v @ w / 2, *turning, motor]

    expected = np.array([*q, *w, momentum])
    for steps, on in ((1, motor), (frameskip, motor * held)):
        span, accuracy = (0, steps / 240), {"rtol": 1e-13, "atol": 1e-15}
        expected = solve_ivp(rate, span, expected, "DOP853", args=(on,), **accuracy).y[:, -1]

    body = equations.EquationsOfMotion.of(jnp.asarray(LM50), jnp.zeros(3)).coasting()
    laws = WheelEquations(body, tuple(jnp.asarray(LM50)), jnp.asarray(motor))
    start = WheelState(jnp.asarray(momentum), equations.RigidState.of(q, w))
    batch = jax.tree.map(lambda x: x[None], start)
    agent_step = integration.AgentStep(frameskip, held)
    in_groups = [functools.partial(integration.change_in_groups, x) for x in (one_loop, one_kernel)]
    for change in (integration.change, integration.change_by_scan, *in_groups):
        fly = jax.jit(jax.vmap(functools.partial(change, agent_step), (0, None, None)))
        after = equations.add(batch, fly(batch, laws, None))
        ours = [*after.rigid.quaternion, *after.rigid.angular_velocity, after.momentum]
        np.testing.assert_allclose(np.squeeze(ours), expected, rtol=0, atol=1e-11)


@BODIES
def test_rate_is_that_of_the_vector_equations(x64, inertia):
    """Each term by itself: the torque, the gyroscopic term, and the kinematics."""
    tensor = np.diag(inertia) if inertia.ndim == 1 else inertia
    for q, w, torque in zip(*random_spacecraft(4)):
        state = equations.RigidState.of(q, w)
        laws = equations.EquationsOfMotion.of(jnp.asarray(inertia), torque)
        gyroscopic = -np.linalg.solve(tensor, np.cross(w, tensor @ w))
        commanded = np.linalg.solve(tensor, torque)
        for motion, expected in ((laws, gyroscopic + commanded), (laws.coasting(), gyroscopic)):
            rate = motion.rate(state)
            np.testing.assert_allclose(rate.angular_velocity, expected, rtol=0, atol=1e-13)
            np.testing.assert_array_equal(rate.quaternion, quaternion.derivative(q, w))
