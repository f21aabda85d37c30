"""benchmarks/askew.py: spacecraft whose torque axes are askew, for docs/universal.md."""

import importlib
import json

import numpy as np
import pytest
from commands import ROOT


@pytest.fixture
def script(monkeypatch):
    """The module."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("askew")


def test_directions_are_unit_vectors_that_span_such_volumes(script):
    random = np.random.default_rng(0)
    for volumes in script.VOLUMES:
        axes = script.directions(random, volumes, 50)
        assert axes.shape == (50, 3, 3)
        np.testing.assert_allclose(np.linalg.norm(axes, axis=2), 1)
        spanned = abs(np.linalg.det(axes))
        assert np.all((volumes[0] <= spanned + 1e-12) & (spanned <= volumes[1] + 1e-12))


def test_where_the_axes_are_orthogonal_it_is_the_fleet_that_eval_flies(script, capsys, monkeypatch):
    from attjax import AttitudeEnv
    from attjax.control.classical import phase_plane
    from attjax.evaluation import evaluate_fleet

    monkeypatch.setattr(script, "VOLUMES", ((1.0, 1.0), (0.2, 0.4)))
    assert script.main(["--episodes", "20", "--frameskip", "20"]) == 0
    orthogonal, askew = map(json.loads, capsys.readouterr().out.splitlines())
    judged = evaluate_fleet(phase_plane, AttitudeEnv(20), episodes=20)
    for name in ("success_rate", "overspeed_rate", "settling_over_estimate"):
        assert orthogonal[name] == pytest.approx(judged[name], rel=1e-6)
    assert askew["settling_over_estimate"] > 1.2 * orthogonal["settling_over_estimate"]
