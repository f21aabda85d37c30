"""Training and judging from Python: in memory, or in a folder as the programs do."""

import json

import jax
import numpy as np
import pytest
from commands import STEPS_PER_UPDATE, TINY, eval_script, run

import attjax
from attjax import LM50, AttitudeEnv, Spacecraft
from attjax.config.presets import PAPER_FAST
from attjax.control import classical
from attjax.errors import UserError
from attjax.runs import checkpoint
from attjax.runs.folder import FolderError
from attjax.runs.keeper import Place
from attjax.runs.run import Diverged

SMALL = {
    "frameskips": (5, 20), "num_envs": 16, "rollout_length": 8, "minibatch_size": 32,
    "hidden_sizes": (16,), "updates_per_block": 2,
}  # fmt: skip


def same(a, b):
    jax.tree.map(np.testing.assert_array_equal, a, b)


def test_a_run_in_memory_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    trained = attjax.train("precise", total_steps=4 * STEPS_PER_UPDATE, seed=3, **SMALL)
    assert list(tmp_path.iterdir()) == []
    assert (trained.update, trained.agent_steps) == (4, 4 * STEPS_PER_UPDATE)
    assert (trained.config.seed, trained.env.frameskip, trained.env.spacecraft) == (3, 5, LM50)
    np.testing.assert_array_equal(trained.metrics["agent_steps"], [256, 512])
    assert np.all(np.diff(trained.metrics["wall_s"]) >= 0)
    judged = attjax.evaluate(trained.policy, trained.env, episodes=4)
    assert (judged["episodes"], judged["frameskip"], judged["seed"]) == (4, 5, 0)


def test_python_and_train_py_end_on_the_same_bits(tmp_path):
    """A folder is the same from either, and the policy of a run in memory, too."""
    total = 4 * STEPS_PER_UPDATE
    arguments = [*TINY, "--total-steps", total, "--seed", 5, "--checkpoint", tmp_path / "script"]
    assert run("train.py", *arguments).returncode == 0
    here = attjax.train("precise", total_steps=total, seed=5, folder=tmp_path / "python", **SMALL)
    memory = attjax.train("precise", total_steps=total, seed=5, **SMALL)
    policies = [attjax.load_policy(tmp_path / name).args[0] for name in ("script", "python")]
    same(policies[0], here.policy.args[0])
    same(policies[1], memory.policy.args[0])
    texts = [(tmp_path / name / "config.json").read_text() for name in ("script", "python")]
    configs = [json.loads(text) | {"run": None} for text in texts]
    assert configs[0] == configs[1]


def test_a_run_goes_on_in_its_folder(tmp_path):
    first = attjax.train("precise", total_steps=2 * STEPS_PER_UPDATE, folder=tmp_path, **SMALL)
    with pytest.raises(FolderError, match="holds a run already"):
        attjax.train("precise", total_steps=2 * STEPS_PER_UPDATE, folder=tmp_path, **SMALL)
    place = Place(folder=tmp_path, resume=True)
    with pytest.raises(UserError, match=r"leave out clip \(0.2\)"):
        attjax.train(clip=0.1, folder=place)
    longer = attjax.train(total_steps=4 * STEPS_PER_UPDATE, folder=place)
    assert (first.update, longer.update, checkpoint.latest(tmp_path)) == (2, 4, 4)
    np.testing.assert_array_equal(longer.metrics["agent_steps"], [256, 512])


def test_a_callback_hears_every_block_and_can_end_the_run(tmp_path):
    steps = []

    def callback(row):
        steps.append(row["agent_steps"])
        return len(steps) == 2

    total = 8 * STEPS_PER_UPDATE
    stopped = attjax.train("precise", total_steps=total, callback=callback, **SMALL)
    assert steps == [256, 512] and stopped.agent_steps == 512 and not stopped.is_complete


def test_settings_and_spacecraft_of_ones_own():
    craft = Spacecraft(name="cube", inertia=(0.05, 0.14, 0.17), torque_levels=(0.002,), duration=20)
    small = {name: value for name, value in SMALL.items() if name != "frameskips"}
    settings = PAPER_FAST.replace(total_steps=STEPS_PER_UPDATE, **small)
    trained = attjax.train(settings, spacecraft=craft)
    assert trained.config.preset == "custom" and trained.config.settings == settings
    assert (trained.env.spacecraft, trained.env.num_actions, trained.env.frameskip) == (
        craft,
        7,
        20,
    )


@pytest.mark.parametrize(
    "given, message",
    [
        (
            {"preset": "fast"},
            "preset is 'fast'; it must be one of precise, precise-gpu, universal",
        ),
        ({"gravity": 1}, "unknown or missing: gravity"),
        ({"num_envs": 0}, "num_envs is 0; it must be an integer at least 1"),
        ({"rate_margin": 1e-9}, "masks every torque"),
    ],
)
def test_what_cannot_be_trained_is_told_in_a_line(given, message):
    with pytest.raises(ValueError, match=message) as error:
        attjax.train(**given)
    assert "\n" not in str(error.value)


def test_divergence_raises(tmp_path):
    with pytest.raises(
        Diverged, match=r"not finite at agent step 128 \(update 0\): .*no checkpoint"
    ):
        attjax.train(
            "precise", learning_rate=1e30, reward_scale=1e30, total_steps=2 * STEPS_PER_UPDATE,
            folder=tmp_path, **SMALL,
        )  # fmt: skip


def test_evaluate_is_what_eval_py_writes(tmp_path):
    path = tmp_path / "result.json"
    arguments = ["--controller=phase-plane", "--episodes=20", "--frameskip=20", "--seed=4"]
    assert eval_script.main([*arguments, "--device=cpu", "--json", str(path)]) == 0
    env = AttitudeEnv(frameskip=20)
    ours = attjax.evaluate(classical.phase_plane, env, episodes=20, seed=4)
    assert {"controller": "phase-plane"} | ours == json.loads(path.read_text())


def test_every_public_name_is_there_and_told():
    assert set(attjax.__all__) <= set(dir(attjax))
    for name in attjax.__all__:
        assert getattr(attjax, name).__doc__ is not None or name == "LM50"
