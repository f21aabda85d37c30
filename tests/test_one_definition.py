"""A change of the inputs or of the mask, in the one place, changes JAX, C and ONNX alike."""

import functools
from typing import NamedTuple

import exported
import numpy as np
import pytest
from exported import needs_compiler, random_states

from attjax.config import settings
from attjax.control import assurance, features
from attjax.control.features import Multiscale
from attjax.dynamics import quaternion
from attjax.export import c as export_c
from attjax.export import inputs as export_inputs

KINEMATICS, RATE_MASK = quaternion.derivative, assurance.rate_mask


class Change(NamedTuple):
    """What is changed, and a policy whose decisions hang on it."""

    place: object
    name: str
    value: object
    features: str = "multiscale"
    rate_margin: float = 0.0


def other_kinematics(quaternion, angular_velocity, factor=0.5):
    """Without the ½, and two of its components in each other's place."""
    first, second, third, last = (2.0 * x for x in KINEMATICS(quaternion, angular_velocity, factor))
    return first, third, second, last


def other_mask(context, margin, **factors):
    mask = RATE_MASK(context, margin)
    return mask.replace(**{name: getattr(mask, name) * x for name, x in factors.items()})


CHANGES = {
    "scales": Change(features, "SCALES", (1.0, 7.0, 300.0)),
    "the period that inputs scale to": Change(features, "FEATURE_PERIOD", 0.5),
    "the attitude's factor": Change(
        Multiscale, "attitude_factor", property(lambda self: 0.3 + self.control_period)
    ),
    "what tells the period": Change(
        Multiscale,
        "period",
        property(lambda self: (100 * self.control_period, 3.0, self.control_period**2)),
    ),
    "kinematics": Change(quaternion, "derivative", other_kinematics, "state"),
    **{
        f"the mask's {name}": Change(
            assurance, "rate_mask", functools.partial(other_mask, **{name: x}), "state", 0.99
        )
        for name, x in {"form": 1.5, "impulse": -3, "own_gain": 200, "limit_squared": 0.2}.items()
    },
}


def fly(change):
    """A policy, whose trained part no change alters, and what JAX decides."""
    untrained = exported.untrained.__wrapped__
    flight = untrained(change.features, (16,), change.rate_margin)
    return flight, random_states.__wrapped__(flight)


@pytest.fixture(params=CHANGES.values(), ids=CHANGES)
def changed(request, monkeypatch):
    """A policy and its decisions after a change that is seen in them."""
    change = request.param
    _, before = fly(change)
    monkeypatch.setattr(change.place, change.name, change.value)
    flight, states = fly(change)
    assert np.mean(states.action != before.action) > 0.02
    assert np.mean(states.clear) > 0.95 and len(np.unique(states.action)) > 3
    return flight, states


@needs_compiler
def test_a_change_reaches_c(changed, tmp_path):
    flight, states = changed
    exported.write(tmp_path, export_c.policy_files(flight))
    assert exported.differing(states, exported.c_actions(tmp_path, states))[0] == 0


def test_a_change_reaches_onnx(changed):
    export_onnx = pytest.importorskip("attjax.export.onnx", exc_type=ImportError)
    pytest.importorskip("onnxruntime")
    flight, states = changed
    action, logits = exported.onnx_outputs(export_onnx.files(flight)[export_onnx.FILES[0]], states)
    assert exported.differing(states, action)[0] == 0
    masked = states.logits[states.clear] < -1e8
    np.testing.assert_array_equal(logits[states.clear] < -1e8, masked)


def test_inputs_that_have_a_name_are_all_written_down_and_offered():
    names = set(features.FEATURES)
    assert names == set(export_inputs.FORMS) == set(settings.FIELDS["features"].metadata["choices"])
