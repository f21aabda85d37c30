"""The same results wherever it runs. What needs a GPU is skipped where there is none."""

import jax
import jax.extend.core
import jax.numpy as jnp
import numpy as np
import pytest
from commands import TINY, run
from setups import SETTINGS

from attjax import AttitudeEnv, ppo, step
from attjax.config import run as run_config
from attjax.ppo import train_state
from attjax.ppo.networks import Policy
from attjax.runs import build, checkpoint
from attjax.runs import folder as run_folder


def gpus():
    try:
        return jax.devices("gpu")
    except RuntimeError:
        return []


needs_gpu = pytest.mark.skipif(not gpus(), reason="there is no GPU")


def products(jaxpr):
    """All matrix products of a program, in its inner programs too."""
    for equation in jaxpr.eqns:
        if equation.primitive.name == "dot_general":
            yield equation
        for inner in jax.extend.core.jaxprs_in_params(equation.params):
            yield from products(inner)


@pytest.mark.parametrize("features", ["state", "multiscale"])
def test_policy_and_value_ask_for_full_precision_products(features):
    """GPUs multiply float32 in tf32, with ten bits, unless asked; that costs the last decades."""
    env, policy = AttitudeEnv(5), Policy(features, rate_margin=0.99)
    context = env.context(env.default_params)
    params = build.initial_parameters(policy)
    observation = jnp.zeros(11).at[3].set(1.0)

    def evaluate(observation):
        inputs = policy.encode(observation, context)
        features = inputs.features[None]
        return policy.act(params, observation, context), policy.value(params, features)

    found = list(products(jax.make_jaxpr(evaluate)(observation).jaxpr))
    assert len(found) >= 6
    highest = jax.lax.Precision.HIGHEST
    assert all(e.params["precision"] in (highest, (highest, highest)) for e in found)


def test_a_run_on_two_devices_goes_on_on_one(tmp_path):
    setup = build.setup(SETTINGS, num_devices=2)
    state = train_state.init(setup, build.env_params(setup), jax.random.key(0))
    run_folder.create(tmp_path, run_config.Config("precise", 0, SETTINGS), overwrite=False)
    with checkpoint.Saver(tmp_path) as saver:
        saver.save(state)
    setup = build.setup(SETTINGS)
    env_params = build.env_params(setup)
    template = train_state.init(setup, env_params, jax.random.key(1))
    restored = checkpoint.restore_learner(tmp_path, template)
    jax.tree.map(np.testing.assert_array_equal, restored.params, state.params)
    np.testing.assert_array_equal(restored.states.quaternion, state.states.quaternion)
    later, _ = ppo.train_block(setup, env_params, restored, 1)
    assert later.update == 1


@needs_gpu
def test_one_agent_step_agrees_on_cpu_and_gpu():
    env = AttitudeEnv(20)
    keys = jax.random.split(jax.random.key(0), 4096)
    results = []
    for device in (jax.devices("cpu")[0], gpus()[0]):
        with jax.default_device(device):
            _, states = jax.vmap(env.reset)(jax.device_put(keys, device))
            actions = jnp.arange(4096) % 19
            results.append(jax.jit(jax.vmap(step))(states, actions))
    a, b = results
    np.testing.assert_allclose(a.quaternion, b.quaternion, atol=1e-6)
    np.testing.assert_allclose(a.angular_velocity, b.angular_velocity, atol=1e-6)


@needs_gpu
@pytest.mark.parametrize("here, there", [("cpu", "gpu"), ("gpu", "cpu")])
def test_checkpoints_travel_between_cpu_and_gpu(tmp_path, here, there):
    tiny = [flag for flag in TINY if not flag.startswith("--device")]
    common = ["--checkpoint", tmp_path / "run"]
    for device, total, more in ((here, 1000, []), (there, 2000, ["--resume"])):
        flags = [*(tiny if not more else []), "--total-steps", total, "--device", device]
        done = run("train.py", *common, *flags, *more)
        assert done.returncode == 0, done.stderr
    for device in (here, there):
        flags = ["--episodes", 10, "--duration", 2, "--device", device]
        assert run("eval.py", *common, *flags).returncode == 0
