"""The agent in the repository still flies as documented."""

from pathlib import Path

import jax
import pytest

from attjax import AttitudeEnv, Spacecraft, evaluation, load_flight_loop
from attjax.evaluation.paper import PAPER_TABLE_2
from attjax.runs import checkpoint

PRETRAINED = Path(__file__).parent.parent / "pretrained"


def flown(name, frameskip):
    """Statistics of 500 slews of a pretrained agent."""
    env = AttitudeEnv(frameskip)
    policy = checkpoint.restore_policy(PRETRAINED / name)
    slews = evaluation.fly(policy, env, env.default_params, jax.random.key(11), 500)
    return evaluation.statistics(slews, env, env.default_params)


@pytest.mark.parametrize("frameskip, settling_s", [(5, 8.8), (20, 16.5)])
def test_pretrained_agent_beats_table_2(frameskip, settling_s):
    result = flown("precise", frameskip)
    assert result["success_rate"] == 1 and result["overspeed_rate"] == 0
    assert result["settling_time_s"]["mean"] < settling_s
    for (state, quantity), paper in PAPER_TABLE_2.items():
        ours = result[state][quantity]
        for statistic, value in zip(evaluation.STATISTICS, paper):
            if statistic != "min":  # a single draw
                assert ours[statistic] < value, (state, quantity, statistic)


@pytest.mark.parametrize(
    "name, success, score", [("paper", (0.6, 0.8), 2_100), ("paper-gae", (0.99, 1), 3_200)]
)
def test_the_papers_reward_brings_its_return_and_not_its_table_2(name, success, score):
    result = flown(name, 20)
    assert success[0] <= result["success_rate"] <= success[1]
    assert result["episode_return"]["mean"] > score
    papers_mean = PAPER_TABLE_2["terminal", "error_deg"][0]
    assert result["terminal"]["error_deg"]["min"] > papers_mean
    assert result["terminal_success"]["error_deg"]["mean"] > 50 * papers_mean


def test_a_saved_policy_in_a_flight_loop_flies_on_both_devices():
    """More slews than one device is given, of parameters that were read onto one."""
    env = AttitudeEnv(20, spacecraft=Spacecraft(duration=3))
    loop = load_flight_loop(PRETRAINED / "precise")
    assert len(jax.devices()) == 2
    slews = evaluation.fly(loop, env, env.default_params, jax.random.key(1), 600)
    alone = evaluation.fly(loop.controller, env, env.default_params, jax.random.key(1), 600)
    assert (slews.terminal_angle == alone.terminal_angle).all()


@pytest.mark.parametrize("frameskip", [5, 20])
def test_the_universal_agent_flies_any_spacecraft(frameskip):
    policy = checkpoint.restore_policy(PRETRAINED / "universal")
    judged = evaluation.evaluate_fleet(policy, AttitudeEnv(frameskip), episodes=1000, seed=11)
    assert judged["success_rate"] == 1 and judged["overspeed_rate"] == 0
    assert judged["settling_over_estimate"] < 1.03
    assert judged["terminal_over_quantisation"] < 1.4
