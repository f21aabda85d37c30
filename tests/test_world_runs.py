"""A run in an imperfect world: trained at several rates, resumed, judged there or elsewhere."""

import json

import pytest
from commands import ROOT, TINY, eval_script, one_line_error, train_script

from attjax import World
from attjax.runs import folder as run_folder

EXAMPLE = ROOT / "docs" / "examples" / "leo.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a short run from the command line, in two parts."""
    folder = tmp_path_factory.mktemp("world") / "ckpt"
    place = ["--checkpoint", str(folder), "--device=cpu"]
    assert train_script.main([*TINY, *place, f"--world={EXAMPLE}", "--total-steps=256"]) == 0
    assert train_script.main([*place, "--resume", "--total-steps=512"]) == 0
    return folder


def judged(capsys, *flags):
    flags = ["--episodes=4", "--frameskip=20", "--device=cpu", "--json=-", *map(str, flags)]
    assert eval_script.main(flags) == 0
    return json.loads(capsys.readouterr().out)


def test_the_world_is_kept_with_the_run(folder):
    assert run_folder.read_config(folder).world == World.from_toml(EXAMPLE)


def test_a_run_is_judged_in_its_world_or_in_another(folder, capsys):
    own = judged(capsys, "--checkpoint", folder)
    ideal = judged(capsys, "--checkpoint", folder, "--world=ideal")
    assert own["world"] == "low orbit" and "world" not in ideal
    assert own["terminal"] != ideal["terminal"]


def test_the_report_names_the_world(folder, capsys):
    flags = ["--controller=feedback", "--episodes=4", "--frameskip=20", "--device=cpu"]
    assert eval_script.main([*flags, f"--world={EXAMPLE}"]) == 0
    printed = capsys.readouterr().out
    assert "world low orbit, seed 0" in printed and "paper" not in printed
    assert eval_script.main(flags) == 0
    assert "world" not in capsys.readouterr().out


def test_the_same_seed_is_the_same_world(folder, capsys):
    """For whichever controller: the pretrained policy's own slews, drawn twice."""
    first, again = (judged(capsys, "--controller=feedback", f"--world={EXAMPLE}") for _ in range(2))
    assert first == again


@pytest.mark.parametrize(
    "content",
    [
        "[uncertainty]\ninertia_factor = 1.1\n",
        "[actuators]\ndelay = 3\n",
        "[sensors.gyro]\nresolution = 1e-6\n",
        "[actuators.wheels]\ninertia = 1e-3\n",
        "[disturbances.flexible]\nfrequency = 0.5\nparticipation = 0.1\n",
    ],
)
def test_a_world_with_one_part_flies(tmp_path, capsys, content):
    """What it lacks is nothing at all in the program: XLA crashed on a loop with no results."""
    file = tmp_path / "one_part.toml"
    file.write_text(content)
    result = judged(capsys, "--controller=feedback", f"--world={file}")
    assert result["world"] == "one_part" and result["success_rate"] > 0


@pytest.mark.parametrize(
    "content, said",
    [
        ("[actuators]\ndelay = 20000\n", "delay is 20000"),
        ("[actuators]\ndelay = 10500\n", "they must be at most 10499"),
        ("[actuators]\ndead_levels = [7]\n", "LM50 has 3 torque_levels"),
        ("[sensors.gyro]\nresolution = -1\n", "sensors.gyro.resolution is -1"),
        ("[actuators.wheels]\ninertia = 0.1\n", "wheels comes to 0.3; it must be below"),
        ("[sensors\n", "is no TOML"),
    ],
)
def test_a_bad_world_is_one_line(tmp_path, capsys, content, said):
    file = tmp_path / "bad.toml"
    file.write_text(content)
    for main, flags in (
        (eval_script.main, ["--controller=feedback"]),
        (train_script.main, [f"--checkpoint={tmp_path / 'ckpt'}"]),
    ):
        assert said in one_line_error(main, [*flags, f"--world={file}"], capsys)
    assert not (tmp_path / "ckpt").exists()


def test_a_missing_world_is_one_line(capsys):
    said = one_line_error(eval_script.main, ["--controller=feedback", "--world=heaven"], capsys)
    known = "ideal or cubesat-6u or innocube-3u or lm50-leo or stress"
    assert f"--world is heaven; it must be {known}, or a TOML file" in said
