"""eval.py --assured, and the cones of --keep-out."""

import json

import pytest
from commands import ROOT, eval_script, one_line_error

SUN = ROOT / "docs" / "examples" / "sun.toml"
FLAGS = ["--controller=feedback", "--episodes=4", "--frameskip=20", "--device=cpu"]


def test_it_says_in_json_and_in_the_report_that_it_flew_assured(capsys):
    flags = [*FLAGS, "--assured", f"--keep-out={SUN}"]
    assert eval_script.main([*flags, "--json=-"]) == 0
    output = capsys.readouterr()
    judged = json.loads(output.out)
    assert judged["assured"] is True and judged["keep_out"] == 1
    assert "assured: limits and 1 cone, for every plant that the world states" in output.err
    assert eval_script.main([*FLAGS, "--json=-"]) == 0
    assert "assured" not in json.loads(capsys.readouterr().out)


def test_a_loop_that_adapts_is_assured(capsys, tmp_path):
    turned = tmp_path / "turned.toml"
    turned.write_text("[uncertainty]\naxes_turned_deg = 10\n")
    flags = [*FLAGS, "--adaptive", "--assured", f"--world={turned}", "--duration=5"]
    assert eval_script.main([*flags, "--json=-"]) == 0
    output = capsys.readouterr()
    judged = json.loads(output.out)
    assert judged["controller"] == "feedback, adaptive" and judged["assured"] is True
    assert judged["overspeed_rate"] == 0
    assert "feedback, adaptive: 4 slews" in output.err and "assured: limits, for" in output.err


@pytest.mark.parametrize("flags", [[], ["--bare"], ["--sampled"]])
def test_a_universal_policy_is_assured_as_any(capsys, flags):
    flags = ["--checkpoint=pretrained/universal", *FLAGS[1:], *flags, "--duration=2", "--json=-"]
    assert eval_script.main([*flags, "--assured"]) == 0
    assert json.loads(capsys.readouterr().out)["assured"] is True


def test_it_says_which_policy_takes_over(capsys):
    flags = ["--checkpoint=pretrained/universal", *FLAGS[1:], "--duration=2", "--episodes=2"]
    said = "where an axis is found to be dead: the policy in pretrained/universal/two-torques"
    for more, is_said in (["--adaptive"], True), ([], False):
        assert eval_script.main([*flags, *more]) == 0
        assert (said in capsys.readouterr().out) is is_said


def test_a_world_in_which_nothing_is_proved_is_flown_with_a_warning(capsys, tmp_path):
    weak = tmp_path / "weak.toml"
    weak.write_text("[disturbances]\nconstant_torque = 0.2\n")
    assert eval_script.main([*FLAGS, "--assured", f"--world={weak}", "--json=-"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out)["assured"] is False
    assert "warning: nothing is proved of this world" in output.err
    assert "assured: limits, as well as it can" in output.err


def test_cones_that_leave_nothing_to_turn_to_are_warned_of(capsys):
    """In lm50-leo it may drift by 147 degrees: what is let through there is to stand still."""
    flags = [*FLAGS, "--assured", f"--keep-out={SUN}", "--duration=43.75", "--json=-"]
    assert eval_script.main([*flags, "--world=lm50-leo"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out)["success_rate"] == 0
    assert "warning: the spacecraft will hardly turn" in output.err and "by 147° in" in output.err
    assert eval_script.main([*flags, "--duration=5"]) == 0
    assert "warning" not in capsys.readouterr().err


@pytest.mark.parametrize(
    "flags, said",
    [
        ([f"--keep-out={SUN}"], "--keep-out is for --assured"),
        (["--assured", "--keep-out=nowhere.toml"], "--keep-out nowhere.toml cannot be read"),
        (["--assured", "--actions=continuous"], "over a finite set of actions"),
        (["--adaptive", "--bare"], "--adaptive does not go with --bare"),
        (["--adaptive", "--world=cubesat-6u"], "cannot adapt to reaction wheels yet"),
    ],
)
def test_what_does_not_go_is_one_line(capsys, flags, said):
    assert said in one_line_error(eval_script.main, [*FLAGS, *flags], capsys)


def test_a_bad_file_of_cones_is_one_line(capsys, tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text("[[keep_out]]\naxis = [0, 0, 1]\ndirection = [1, 0, 0]\nhalf_angle_deg = 200\n")
    said = one_line_error(eval_script.main, [*FLAGS, "--assured", f"--keep-out={file}"], capsys)
    assert "keep_out[1].half_angle_deg is 200" in said
