"""Same seed, same bits, however often the run reports and saves; another seed, other numbers."""

import jax
import numpy as np
from commands import STEPS_PER_UPDATE, TINY, run
from setups import small_attitude_setup

from attjax.ppo import train_state
from attjax.runs import build, checkpoint


def test_reporting_and_saving_do_not_change_the_run(trained, tmp_path):
    """Another process, other blocks, a checkpoint after each of them: the same policy."""
    folder = tmp_path / "again"
    arguments = [*TINY, "--total-steps", 60 * STEPS_PER_UPDATE, "--checkpoint", folder]
    result = run("train.py", *arguments, "--updates-per-block", 7, "--save-every", 0)
    assert result.returncode == 0, result.stderr
    a, b = (checkpoint.restore_policy(path).args[0] for path in (trained[0], folder))
    jax.tree.map(np.testing.assert_array_equal, a, b)


def test_the_seed_reaches_everything_random():
    setup = small_attitude_setup(updates=1)
    env_params = build.env_params(setup)
    a, b, again = (train_state.init(setup, env_params, jax.random.key(seed)) for seed in (0, 1, 0))
    jax.tree.map(np.testing.assert_array_equal, a.params, again.params)
    jax.tree.map(np.testing.assert_array_equal, a.states, again.states)
    for network in ("policy", "value"):
        for layer, values in a.params[network]["params"].items():
            other = b.params[network]["params"][layer]
            assert not np.any(values["kernel"] == other["kernel"])
    rows = np.concatenate([a.states.quaternion, b.states.quaternion])
    assert len(np.unique(rows, axis=0)) == len(rows)
    assert np.any(a.states.time != b.states.time)
    assert np.any(jax.random.key_data(a.key) != jax.random.key_data(b.key))
