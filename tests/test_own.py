"""A user's own spacecraft, reward and features, from the command line."""

import json
import sys

import jax
import pytest
from commands import ROOT, STEPS_PER_UPDATE, TINY, eval_script, one_line_error, run, train_script

from attjax import AttitudeEnv
from attjax.config import presets, user_functions
from attjax.config.user_functions import FunctionError
from attjax.envs.reward import logarithmic_reward
from attjax.runs import build, checkpoint
from attjax.runs import folder as run_folder

EXAMPLES = ROOT / "docs" / "examples"
CUBESAT = str(EXAMPLES / "cubesat.toml")
OWN = ["--reward", "rewards:frugal", "--features", "rewards:with_momentum"]
SMALL = ["--device", "cpu", "--episodes", "5", "--duration", "3"]


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A short run with everything a user's own, started in the folder of their module."""
    folder = tmp_path_factory.mktemp("own") / "ckpt"
    flags = [*TINY, *OWN, "--spacecraft", CUBESAT, "--checkpoint", folder]
    result = run("train.py", *flags, "--total-steps", 4 * STEPS_PER_UPDATE, cwd=EXAMPLES)
    assert result.returncode == 0, result.stderr
    assert "6U CubeSat" in result.stdout
    return folder


def test_a_run_goes_on_with_what_it_was_started_with(own):
    total = 6 * STEPS_PER_UPDATE
    flags = ["--resume", "--checkpoint", own, "--total-steps", total, "--device", "cpu"]
    result = run("train.py", *flags, cwd=EXAMPLES)
    assert result.returncode == 0 and "resumed at" in result.stdout, result.stderr
    config = run_folder.read_config(own)
    assert (config.spacecraft.name, config.settings.task.reward) == ("6U CubeSat", "rewards:frugal")


def test_a_policy_flies_the_spacecraft_that_it_was_trained_on(own, tmp_path):
    path = tmp_path / "result.json"
    result = run("eval.py", "--checkpoint", own, *SMALL, "--json", path, cwd=EXAMPLES)
    assert result.returncode == 0, result.stderr
    assert "6U CubeSat" in result.stdout and "paper" not in result.stdout
    # 2 mN m at most, for 3 s.
    assert json.loads(path.read_text())["impulse_N_m_s"]["max"] <= 2e-3 * 3 * 1.001


def test_the_users_functions_are_what_learns(monkeypatch):
    """The reward that reaches the learner and the network's inputs are the user's."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    settings = presets.PRECISE.replace(reward="rewards:frugal", features="rewards:with_momentum")
    env, policy = (getattr(build.setup(settings), name) for name in ("env", "policy"))
    params = env.default_params
    observation, state = env.reset(jax.random.key(0), params)
    assert policy.encode(observation, env.context(params)).features.shape == (60,)
    usual = AttitudeEnv(env.frameskip, logarithmic_reward)
    for action, impulse in ((1, 0.5 / 240), (0, 0.0)):
        own, expected = (e.step_env(None, state, action, params)[2] for e in (env, usual))
        assert float(expected - own) == pytest.approx(2e4 * impulse, rel=1e-4)


def test_policies_with_features_of_their_own_export_as_stablehlo_alone(own, tmp_path):
    flags = ["--checkpoint", own, "--device", "cpu", "--out", tmp_path / "out", "--format"]
    refused = run("export.py", *flags, "c", cwd=EXAMPLES)
    assert refused.returncode == 2
    assert "sees rewards:with_momentum, which --format c does not know" in refused.stderr
    pytest.importorskip("flatbuffers")
    written = run("export.py", *flags, "stablehlo", cwd=EXAMPLES)
    assert written.returncode == 0, written.stderr


def test_a_policy_refuses_a_spacecraft_with_other_actions(trained, tmp_path, capsys):
    path = tmp_path / "two.toml"
    path.write_text("inertia = [1, 1, 1]\ntorque_levels = [0.1]\n")
    flags = ["--checkpoint", str(trained[0]), "--spacecraft", str(path), *SMALL]
    error = one_line_error(eval_script.main, flags, capsys)
    assert "two.toml has 7 actions; the policy in" in error and "chooses among 19" in error


def test_a_policy_can_be_tried_on_another_spacecraft(trained, tmp_path, capsys):
    path = tmp_path / "heavier.toml"
    path.write_text(
        'name = "[/heavier]"\n'
        + "inertia = [0.96, 0.13, 0.88]\ntorque_levels = [0.5, 0.05, 0.005]\n"
    )
    flags = ["--checkpoint", str(trained[0]), "--spacecraft", str(path), *SMALL]
    assert eval_script.main(flags) == 0
    assert "[/heavier]" in capsys.readouterr().out


@pytest.mark.parametrize(
    "text, expected",
    [
        ("inertia = [1, 1, 1]", "torque_levels is missing"),
        ("torque_levels = [1]", "inertia is missing; there must be inertia and torque_levels"),
        ("inertia = 3\ntorque_levels = [1]", "inertia is 3; it must be 3 numbers"),
        ("mass = 3", "mass is unknown"),
        ("[spacecraft]", "spacecraft is unknown"),
        ("inertia = [", "is no TOML"),
    ],
)
def test_bad_spacecraft_files(tmp_path, capsys, text, expected):
    path = tmp_path / "craft.toml"
    path.write_text(text)
    for main in (train_script.main, eval_script.main):
        flags = ["--spacecraft", str(path), "--checkpoint", str(tmp_path / "ckpt")]
        if main is eval_script.main:
            flags += ["--controller", "phase-plane"]
        error = one_line_error(main, flags, capsys)
        assert f"--spacecraft {path}" in error and expected in error
    assert not (tmp_path / "ckpt").exists()


def test_a_mask_that_leaves_no_torque_is_refused(tmp_path, capsys):
    path = tmp_path / "strong.toml"
    inertia = "inertia = [0.05, 0.14, 0.17]"
    path.write_text(f"{inertia}\ntorque_levels = [2.0, 1.0]\ntorque_held = true\n")
    flags = [*TINY, "--preset", "precise", "--spacecraft", str(path), "--frameskips", "23"]
    message = one_line_error(
        train_script.main, [*flags, "--checkpoint", str(tmp_path / "run")], capsys
    )
    assert "rate_margin 0.99 masks every torque of strong with frameskip 23" in message
    assert not list((tmp_path / "run").iterdir())


def test_a_tensor_that_single_precision_cannot_follow_is_refused(tmp_path, capsys):
    path = tmp_path / "needle.toml"
    tensor = "inertia = [[1.0, 0.1, 0], [0.1, 1.0, 0], [0, 0, 0.2]]"
    path.write_text(f"{tensor}\ntorque_levels = [1e-3]\nrate_limit = 5.0\n")
    arguments = ["--controller", "phase-plane", "--spacecraft", str(path), "--device", "cpu"]
    message = one_line_error(eval_script.main, [*arguments, "--duration", "9000"], capsys)
    assert "--duration 9000" in message and "at most 7273 s at a rate_limit of 5" in message


def test_settings_that_do_not_fit_the_spacecraft(tmp_path, capsys):
    path = tmp_path / "craft.toml"
    path.write_text("inertia = [1, 1, 1]\ntorque_levels = [1]\nduration = 0.05\n")
    error = one_line_error(train_script.main, ["--spacecraft", str(path)], capsys)
    assert "frameskips holds 20; in 0.05 s, the duration of an episode, it must be at most" in error
    flags = ["--spacecraft", str(path), "--controller", "feedback", "--frameskip", "20"]
    error = one_line_error(eval_script.main, flags, capsys)
    assert "--duration is 0.05 s; it must hold at least one agent step of 0.0875 s" in error


MODULE = """
import jax.numpy as jnp
from attjax.envs import reward
number = 3
def vector(transition): return jnp.zeros(3)
def raises(transition): return transition.speed
def text(transition): return "much"
def integer(transition): return 1
def scalar(observation, context): return observation[0]
def one_argument(observation): return observation
"""


@pytest.mark.parametrize(
    "flag, name, expected",
    [
        ("reward", "nowhere:f", "nowhere:f cannot be imported: ModuleNotFoundError"),
        ("reward", "mine:f", "mine:f cannot be imported: AttributeError"),
        ("reward", "mine:number", "mine:number is int; it must be a function"),
        ("reward", "mine:vector", r"reward mine:vector returned shape (3,) and type float32"),
        ("reward", "mine:raises", "failed: AttributeError: 'Transition' object has no attribute"),
        ("reward", "mine:raises", "(mine.py, line 6)"),
        ("reward", "mine:text", "reward mine:text"),
        ("reward", "mine:integer", "reward mine:integer returned shape () and type int32"),
        ("features", "mine:scalar", "features mine:scalar returned shape () and type float32"),
        ("features", "mine:one_argument", "features mine:one_argument failed: TypeError"),
        (
            "reward",
            "best",
            "be one of paper, logarithmic, way, binary, authors, authors-continuous, or "
            "module:function",
        ),
        ("features", "mine.scalar", "or module:function"),
    ],
)
def test_functions_that_cannot_be_used(tmp_path, capsys, monkeypatch, flag, name, expected):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    (tmp_path / "mine.py").write_text(MODULE)
    flags = [*TINY, f"--{flag}", name, "--checkpoint", str(tmp_path / "ckpt"), "--overwrite"]
    assert expected in one_line_error(train_script.main, flags, capsys)
    assert not (tmp_path / "ckpt" / run_folder.CONFIG).exists()


def test_a_run_is_not_overwritten_by_one_that_cannot_start(trained, capsys):
    before = run_folder.read_config(trained[0])
    flags = [*TINY, "--reward", "nowhere:f", "--overwrite", "--checkpoint", str(trained[0])]
    one_line_error(train_script.main, flags, capsys)
    assert run_folder.read_config(trained[0]) == before
    assert checkpoint.latest(trained[0]) is not None


def test_a_checkpoint_whose_function_is_gone_is_one_line(own, tmp_path):
    result = run("eval.py", "--checkpoint", own, *SMALL, cwd=tmp_path)
    assert result.returncode == 2 and result.stderr.count("\n") == 1
    assert "rewards:with_momentum cannot be imported" in result.stderr


def test_names_of_functions():
    assert user_functions.is_name("package.module:function")
    for name in (
        "module",
        "module.function",
        ":f",
        "m:",
        "m:f.g",
        "1m:f",
        "m:f()",
        "a b:c",
        "../m:f",
    ):
        assert not user_functions.is_name(name)
    with pytest.raises(FunctionError):
        user_functions.resolve("math:pi")
