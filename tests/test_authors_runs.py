"""A run by the rules of the authors' public code: trained, judged and refused by them."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from commands import ROOT, eval_script, export_script, one_line_error, train_script

import attjax
from attjax import AttitudeEnv, Spacecraft
from attjax.config import presets
from attjax.runs import build
from attjax.runs import folder as run_folder

RULES = {"kinematic_factor": 1.0, "observes_quaternion_rate": False}
TINY = {"num_envs": 16, "rollout_length": 8, "minibatch_size": 32, "hidden_sizes": (16,)}
FLAGS = [
    "--preset=paper", "--num-envs=16", "--rollout-length=8", "--minibatch-size=32",
    "--hidden-sizes=16", "--total-steps=256", "--device=cpu",
]  # fmt: skip
LM50_AUTHORS = ROOT / "docs" / "examples" / "lm50-authors.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a short run from the command line."""
    folder = tmp_path_factory.mktemp("rules") / "ckpt"
    rules = ["--kinematic-factor=1", "--no-observes-quaternion-rate", "--reward=authors"]
    more = ["--checkpoint", str(folder), "--spacecraft", str(LM50_AUTHORS)]
    assert train_script.main([*FLAGS, *rules, *more]) == 0
    return folder


@pytest.mark.parametrize("reward", ["authors", "authors-continuous"])
def test_training_from_python(reward):
    flags = {"reward": reward, "max_episode_steps": 8}
    run = attjax.train("paper", total_steps=256, **flags, **TINY, **RULES)
    assert run.agent_steps == 256 and np.all(np.isfinite(run.metrics["episode_return"]))
    assert run.env == AttitudeEnv(20, **RULES)  # Eq. 12-13 again
    observation = run.env.reset(jax.random.key(0))[0]
    assert int(run.policy(observation, run.env.context(run.env.default_params))) in range(19)


def test_the_rules_of_the_settings_are_the_environments():
    for names in ({}, RULES):
        settings = presets.PAPER.replace(reward="authors", **names)
        env = build.setup(settings).env
        expected = AttitudeEnv(**names)
        assert env.kinematic_factor == expected.kinematic_factor
        assert env.observes_quaternion_rate == expected.observes_quaternion_rate


def test_the_learner_trains_by_the_rules():
    """From the same weights, other rules lead to other ones; each rule counts."""
    weights = [
        jax.tree.leaves(attjax.train("paper", total_steps=256, **TINY, **rules).policy.args)
        for rules in ({}, {"kinematic_factor": 1.0}, {"observes_quaternion_rate": False})
    ]
    for other in weights[1:]:
        assert any(not np.array_equal(a, b) for a, b in zip(weights[0], other))
    assert not all(np.array_equal(a, b) for a, b in zip(*weights[1:]))


def judged(capsys, *flags):
    flags = ["--episodes=20", "--frameskip=20", "--device=cpu", "--json=-", *map(str, flags)]
    assert eval_script.main(flags) == 0
    return json.loads(capsys.readouterr().out)


def test_eval_flies_the_rules_of_the_checkpoint(folder, capsys):
    craft = Spacecraft.from_toml(LM50_AUTHORS)
    policy = attjax.load_policy(folder)
    by_rules, usual = (
        attjax.evaluate(policy, AttitudeEnv(20, spacecraft=craft, **rules), episodes=20)
        for rules in (RULES, {})
    )
    ours = judged(capsys, "--checkpoint", folder)
    assert ours == {"controller": "policy"} | by_rules
    assert ours["terminal"]["error_deg"]["mean"] != usual["terminal"]["error_deg"]["mean"]
    assert ours["overspeed_rate"] == 0  # at 50 rad/s


def test_the_classical_laws_beside_it_fly_the_same_rules(folder, capsys):
    compared = judged(capsys, "--checkpoint", folder, "--compare")["controllers"]
    alone = judged(capsys, "--controller", "phase-plane")
    beside = next(x for x in compared if x["controller"] == "phase-plane")
    assert beside["success_rate"] == alone["success_rate"] == 1
    assert beside["settling_time_s"]["mean"] < 0.8 * alone["settling_time_s"]["mean"]


def test_playback_shows_the_rules_of_the_checkpoint(folder, tmp_path, capsys):
    flags = ["--checkpoint", folder, "--duration", 2]
    pages = [tmp_path / "theirs.html", tmp_path / "usual.html"]
    judged(capsys, *flags, "--playback", pages[0])
    config = run_folder.read_config(folder)
    assert config.settings.task.kinematic_factor == 1.0
    path = folder / "config.json"
    before = path.read_text()
    path.write_text(before.replace('"kinematic_factor": 1.0', '"kinematic_factor": 0.5'))
    judged(capsys, *flags, "--playback", pages[1])
    path.write_text(before)
    assert pages[0].read_text() != pages[1].read_text()


@pytest.mark.parametrize("format", ["c", "stablehlo"])
def test_what_no_spacecraft_obeys_is_not_exported(folder, tmp_path, capsys, format):
    if format == "stablehlo":
        pytest.importorskip("flatbuffers")
    flags = ["--checkpoint", str(folder), "--format", format, "--out", str(tmp_path)]
    error = one_line_error(export_script.main, flags, capsys)
    assert "kinematic_factor is 1; a spacecraft moves by Eq. 9, with 0.5" in error


def test_a_policy_that_saw_no_rate_is_not_exported(folder, tmp_path, capsys):
    path = folder / "config.json"
    before = path.read_text()
    path.write_text(before.replace('"kinematic_factor": 1.0', '"kinematic_factor": 0.5'))
    flags = ["--checkpoint", str(folder), "--format", "c", "--out", str(tmp_path)]
    error = one_line_error(export_script.main, flags, capsys)
    path.write_text(before)
    assert "observes_quaternion_rate is False" in error


def test_a_factor_out_of_range_is_one_line(tmp_path, capsys):
    flags = [*FLAGS, "--checkpoint", str(tmp_path / "ckpt"), "--kinematic-factor", "1.5"]
    error = one_line_error(train_script.main, flags, capsys)
    assert "kinematic-factor" in error and "above 0 and at most 1" in error


def test_the_authors_rate_limit_is_a_spacecraft():
    craft = Spacecraft.from_toml(LM50_AUTHORS)
    assert craft == Spacecraft(name=craft.name, rate_limit=50)
    env = AttitudeEnv(20, spacecraft=craft, **RULES)
    spinning = env.reset(jax.random.key(0))[1].replace(angular_velocity=jnp.array([0.0, 40.0, 0]))
    for rate, ends in ((1.0, False), (1.3, True)):
        state = spinning.replace(angular_velocity=rate * spinning.angular_velocity)
        assert bool(env.step_env(None, state, 0, env.default_params)[3]) == ends
