"""The actor of another learner in a run folder: flown as it is, and not trained on."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from commands import eval_script, one_line_error, train_script
from doc_commands import python_process

import attjax
from attjax import AttitudeEnv
from attjax.config import presets
from attjax.config import run as run_config
from attjax.export import provenance
from attjax.runs import build, checkpoint, foreign
from attjax.runs import folder as run_folder

SETTINGS = presets.PAPER.replace(
    actions="continuous", hidden_sizes=(16, 8), num_envs=4, rollout_length=1, minibatch_size=4,
    total_steps=48,
)  # fmt: skip
CONFIG = run_config.Config("td3", 5, SETTINGS)
ENV = AttitudeEnv(20, actions="continuous")
RNG = np.random.default_rng(7)
LAYERS = [
    (RNG.normal(size=shape).astype(np.float32) / 4, RNG.normal(size=shape[1]).astype(np.float32))
    for shape in ((11, 16), (16, 8), (8, 3))
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of the actor after 12 updates, with an earlier one of zeros beside it."""
    folder = tmp_path_factory.mktemp("foreign") / "td3"
    zeros = [(0 * kernel, 0 * bias) for kernel, bias in LAYERS]
    with run_folder.opened(folder):
        run_folder.create(folder, CONFIG, overwrite=False)
        with checkpoint.Saver(folder) as saver:
            for update, layers, error in ((5, zeros, 1.0), (12, LAYERS, 2.0)):
                learner = foreign.learner(foreign.gaussian_params(layers, std=0.1), update)
                saver.save(learner, terminal_error=error)
    return folder


def actor(observation):
    """In float64, layer by layer."""
    x = np.asarray(observation, float)
    for kernel, bias in LAYERS[:-1]:
        x = np.maximum(x @ kernel.astype(float) + bias, 0)
    kernel, bias = LAYERS[-1]
    return np.tanh(x @ kernel.astype(float) + bias)


def test_the_policy_acts_as_the_actor(folder):
    observations = RNG.normal(size=(200, 11)).astype(np.float32)
    act, context = attjax.load_policy(folder), ENV.context(ENV.default_params)
    ours = jax.vmap(act, (0, None))(jnp.asarray(observations), context)
    expected = actor(observations)
    np.testing.assert_allclose(ours, expected, rtol=0, atol=1e-6)
    assert np.min(np.ptp(expected, axis=0)) > 0.5


def test_it_explores_as_the_actor_did(folder):
    policy, params = checkpoint.restore_network(folder)
    observation = jnp.asarray(RNG.normal(size=11), jnp.float32)
    inputs = policy.encode(observation, ENV.context(ENV.default_params))
    drawn_from = policy.distribution(params, jax.tree.map(lambda x: x[None], inputs))
    np.testing.assert_allclose(np.exp(drawn_from.log_std), 0.1, rtol=1e-6)
    np.testing.assert_allclose(drawn_from.mean[:, 0], actor(observation), rtol=0, atol=1e-6)


def test_the_best_is_kept_beside_the_newest(folder):
    act = attjax.load_policy(folder, use_best=True)
    assert act(jnp.ones(11), ENV.context(ENV.default_params)).tolist() == [0, 0, 0]


def test_eval_judges_it_beside_the_classical_laws(folder, capsys):
    flags = ["--episodes=20", "--frameskip=20", "--device=cpu", "--json=-", "--compare"]
    assert eval_script.main([*flags, f"--checkpoint={folder}"]) == 0
    results = {x["controller"]: x for x in json.loads(capsys.readouterr().out)["controllers"]}
    expected = attjax.evaluate(attjax.load_policy(folder), ENV, episodes=20)
    assert results["policy"] == {"controller": "policy"} | expected
    assert results["phase-plane"]["success_rate"] == 1


def test_resume_is_refused(folder, capsys):
    flags = ["--resume", "--device=cpu", "--checkpoint", str(folder)]
    error = one_line_error(train_script.main, flags, capsys)
    assert "--resume goes on with runs of PPO; this one is of TD3" in error
    assert checkpoint.latest(folder) == 12 and run_folder.read_config(folder) == CONFIG


def test_no_run_of_ppo_can_be_called_so():
    with pytest.raises(ValueError, match="preset is 'td3'; it must be one of precise"):
        run_config.new("td3")


def test_what_is_exported_says_who_learned_it():
    text = provenance.of_run(CONFIG, update=12, newest=12).text
    assert text == "preset td3 (learned by TD3, no PPO), seed 5, update 12 of 12"


def test_the_parameters_are_those_of_a_policy_of_its_settings():
    params = foreign.gaussian_params(LAYERS, std=0.2)
    of_settings = build.initial_parameters(build.policy(SETTINGS))["policy"]
    assert jax.tree.map(jnp.shape, params) == jax.tree.map(jnp.shape, of_settings)


@pytest.mark.parametrize(
    "flags, message",
    [
        (["--reward=best"], "argument --reward: invalid choice: 'best'"),
        (["--reward-scale=0"], "reward-scale is 0.0; it must be a number above 0"),
        (["--seed=-1"], "seed is -1; it must be an integer at least 0"),
        (["--steps=0"], "steps is 0; it must be an integer at least 1"),
        (["--every=0"], "every is 0; it must be an integer at least 1"),
        (["--slews=0"], "slews is 0; it must be an integer at least 1"),
        (["--resume"], "holds no run to resume"),
    ],
)
def test_bad_flags_of_the_benchmark_are_one_line(tmp_path, flags, message):
    out = ["--out", str(tmp_path / "run")]
    result = python_process("benchmarks/td3.py", *out, *flags)
    assert result.returncode == 2 and result.stderr.count("\n") == 1
    assert result.stderr.startswith("td3.py: error: ") and message in result.stderr
    assert not (tmp_path / "run").exists()
