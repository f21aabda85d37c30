"""The agent in the repository still flies as documented."""

from pathlib import Path

import jax
import pytest

from attjax import AttitudeEnv, evaluation
from attjax.evaluation.paper import PAPER_TABLE_2
from attjax.runs import checkpoint

FOLDER = Path(__file__).parent.parent / "pretrained" / "precise"


@pytest.mark.parametrize("frameskip, settling_s", [(5, 8.8), (20, 16.5)])
def test_pretrained_agent_beats_table_2(frameskip, settling_s):
    env = AttitudeEnv(frameskip)
    flown = evaluation.fly(
        checkpoint.restore_policy(FOLDER), env, env.default_params, jax.random.key(11), 500
    )
    result = evaluation.statistics(flown, env, env.default_params)
    assert result["success_rate"] == 1 and result["overspeed_rate"] == 0
    assert result["settling_time_s"]["mean"] < settling_s
    for (state, quantity), paper in PAPER_TABLE_2.items():
        ours = result[state][quantity]
        for statistic, value in zip(evaluation.STATISTICS, paper):
            if statistic != "min":  # a single draw
                assert ours[statistic] < value, (state, quantity, statistic)
