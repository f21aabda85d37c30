"""benchmarks/adaptation.py: conditions that are not as believed, for docs/adaptation.md."""

import importlib
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from commands import ROOT

from attjax import LM50
from attjax.world import Uncertainty, World

DOUBLING = World(uncertainty=Uncertainty(change_factor=2.0, change_time=0.41))
KEY = jax.random.key(0)


@pytest.fixture
def script(monkeypatch):
    """The module."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module("adaptation")


def test_told_is_the_inertia_that_moves_until_the_next_decision(script):
    env = script.Telling(5, world=DOUBLING)
    params, plain = env.default_params, script.AttitudeEnv(5, world=DOUBLING)
    told, state = env.reset(KEY, params)
    inertias = []
    for _ in range(30):  # of 0.025 s
        np.testing.assert_array_equal(told[:-9], plain.observe(KEY, state, params))
        known = script.informed(
            lambda observation, context: context.inertia, told, env.context(params)
        )
        inertias.append(known)
        told, state, *_ = env.step_env(KEY, state, 1, params)
    believed = jnp.diag(jnp.asarray(LM50.inertia))
    for n, inertia in enumerate(inertias):
        np.testing.assert_allclose(inertia, (2 if n >= 16 else 1) * believed, rtol=1e-6)


def test_a_line_for_each_condition_and_loop(script, capsys):
    words = ["--loops", "plain,told", "--episodes", "4", "--frameskip", "20", "--duration", "2"]
    assert script.main([*words, "inertia x 2", "inertia x 0.5"]) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(row["condition"], row["loop"]) for row in rows] == [
        ("inertia x 2", "plain"), ("inertia x 2", "told"),
        ("inertia x 0.5", "plain"), ("inertia x 0.5", "told"),
    ]  # fmt: skip
    assert all(row["episodes"] == 4 for row in rows)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["inertia x 3"], "no condition 'inertia x 3'; there are ideal, "),
        (["ideal", "--loops", "told"], "told: of a wrong inertia alone"),
        (["inertia x 2", "--loops", "told", "--assured"], "told: of a wrong inertia alone"),
        (["delay of one period", "--loops", "told"], "told: of a wrong inertia alone"),
        (["ideal", "--loops", "plain,guessed"], "--loops: must be of plain, adaptive, told"),
    ],
)
def test_what_cannot_be_flown_is_said_in_a_line(script, capsys, words, said):
    with pytest.raises(SystemExit) as end:
        script.main(words)
    assert end.value.code == 2
    assert said in capsys.readouterr().err
