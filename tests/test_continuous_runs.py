"""A run with continuous torques: trained, resumed, judged, drawn and replayed as any other."""

import json

import jax
import numpy as np
import pytest
from commands import eval_script, one_line_error, train_script

import attjax
from attjax import AttitudeEnv
from attjax.config import presets
from attjax.runs import build
from attjax.runs import folder as run_folder

FLAGS = [
    "--preset=continuous", "--num-envs=16", "--rollout-length=8", "--minibatch-size=32",
    "--hidden-sizes=16", "--device=cpu",
]  # fmt: skip
SKEW = """\
name = "skew"
inertia = [0.9, 0.1, 0.8]
torque_levels = [0.5]
torque_axes = [[1, 1, 0], [0, 1, 0], [0, 0, 1]]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a short run from the command line, in two parts."""
    folder = tmp_path_factory.mktemp("continuous") / "ckpt"
    assert train_script.main([*FLAGS, "--total-steps=256", "--checkpoint", str(folder)]) == 0
    longer = ["--resume", "--total-steps=512", "--device=cpu", "--checkpoint", str(folder)]
    assert train_script.main(longer) == 0
    return folder


def judged(capsys, *flags):
    flags = ["--episodes=20", "--frameskip=5", "--device=cpu", "--json=-", *map(str, flags)]
    assert eval_script.main(flags) == 0
    return json.loads(capsys.readouterr().out)


def test_its_policy_gives_fractions(folder):
    env = AttitudeEnv(frameskip=5, actions="continuous")
    observation = env.reset(jax.random.key(0))[0]
    action = attjax.load_policy(folder)(observation, env.context(env.default_params))
    assert action.shape == (3,) and np.all(np.abs(action) < 1) and np.any(action != 0)
    assert build.of_config(run_folder.read_config(folder)).env.actions == "continuous"


def test_eval_flies_what_load_policy_flies(folder, capsys):
    env = AttitudeEnv(frameskip=5, actions="continuous")
    expected = attjax.evaluate(attjax.load_policy(folder), env, episodes=20)
    assert judged(capsys, "--checkpoint", folder) == {"controller": "policy"} | expected


def test_beside_it_the_classical_laws_give_continuous_torques(folder, capsys):
    compared = judged(capsys, "--checkpoint", folder, "--compare")["controllers"]
    beside = {x["controller"]: x for x in compared}
    for name in ("phase-plane", "feedback"):
        alone = judged(capsys, "--controller", name, "--actions", "continuous")
        discrete = judged(capsys, "--controller", name)
        assert beside[name] == alone != discrete
        assert (
            alone["terminal"]["error_deg"]["max"] < 0.05 * discrete["terminal"]["error_deg"]["max"]
        )


def test_a_sampled_policy_is_another_controller_the_same_for_the_same_seed(folder, capsys):
    greedy, *sampled = (
        judged(capsys, "--checkpoint", folder, *flags)
        for flags in ([], ["--sampled"], ["--sampled"])
    )
    assert sampled[0] == sampled[1] != greedy
    assert sampled[0]["impulse_N_m_s"]["mean"] > 2 * greedy["impulse_N_m_s"]["mean"]


def test_figures_and_playback(folder, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    page, figures = tmp_path / "slews.html", tmp_path / "figures"
    judged(capsys, "--checkpoint", folder, "--duration=2", "--plot", figures, "--playback", page)
    assert {"slew1.png", "distributions.png"} <= {path.name for path in figures.iterdir()}
    assert "phase-plane" in page.read_text()


@pytest.mark.parametrize(
    "flags, named",
    [
        (["--controller=feedback", "--sampled"], "--sampled is for a policy; feedback draws"),
        (["--actions=discrete"], "--actions is discrete; the policy in"),
        (["--actions=some"], "discrete"),
    ],
)
def test_bad_evaluation_arguments(folder, capsys, flags, named):
    flags = ["--checkpoint", str(folder), "--device=cpu", *flags]
    assert named in one_line_error(eval_script.main, flags, capsys)


def test_training_episodes_end_at_the_margin_of_the_rate_limit():
    """Those of discrete actions, which are masked, do not; nor does a policy's evaluation."""
    for preset, margin, expected in (
        ("continuous", 0.96, 0.48), ("continuous", 0.0, 0.5), ("precise", 0.96, 0.5)
    ):  # fmt: skip
        setup = build.setup(presets.PRESETS[preset].replace(rate_margin=margin))
        assert float(build.env_params(setup).rate_limit) == pytest.approx(expected)
        assert float(setup.env.default_params.rate_limit) == 0.5


def test_torques_along_no_body_axis_are_one_line(folder, tmp_path, capsys):
    craft = tmp_path / "skew.toml"
    craft.write_text(SKEW)
    named = "for continuous actions each torque must be along a body axis"
    flags = ["--spacecraft", str(craft), "--device=cpu"]
    training = [*FLAGS, "--checkpoint", str(tmp_path / "ckpt"), *flags]
    assert named in one_line_error(train_script.main, training, capsys)
    assert named in one_line_error(eval_script.main, ["--checkpoint", str(folder), *flags], capsys)
