"""benchmarks/curves.py: the figures of docs/reproduction.md."""

import importlib

import numpy as np
import pytest
from commands import ROOT

ROWS = [
    {"agent_steps": "10", "episodes": "1", "episode_return": "100", "success_rate": "0"},
    {"agent_steps": "20", "episodes": "0", "episode_return": "", "success_rate": ""},
    {"agent_steps": "30", "episodes": "3", "episode_return": "2000", "success_rate": "0.5"},
    {"agent_steps": "40", "episodes": "1", "episode_return": "6000", "success_rate": "1"},
    {"agent_steps": "50", "episodes": "1", "episode_return": "1000", "success_rate": "0"},
]


@pytest.fixture
def curves(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("curves")


def test_means_are_over_the_episodes_of_the_last_steps(curves):
    means = curves.averaged(ROWS, 20)
    np.testing.assert_array_equal(means["agent_steps"], [30, 40, 50])
    np.testing.assert_array_equal(means["episode_return"], [2000, 3000, 3500])
    np.testing.assert_array_equal(means["success_rate"], [0.5, 0.625, 0.5])


def test_the_plateau_is_reached_where_the_mean_is(curves):
    row = curves.table_row("run", curves.averaged(ROWS, 20))
    assert row == ["run", "50.0", "40.0", "3,500", "50.0"]
    assert curves.table_row("run", curves.averaged(ROWS[:3], 20))[2] == "not"
