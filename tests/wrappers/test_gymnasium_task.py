"""One task, however it is made: time limit, spec, info, mask; and processes that were forked."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", minversion="1.4")

from commands import ROOT  # noqa: E402
from gymnasium.error import ResetNeeded  # noqa: E402
from gymnasium.wrappers import TimeLimit  # noqa: E402

from attjax import AttitudeEnv  # noqa: E402
from attjax.control import assurance  # noqa: E402
from attjax.wrappers.gymnasium import ID, SlewEnv  # noqa: E402

pytestmark = pytest.mark.filterwarnings("error")
LIMITED = {
    "make": lambda n: gymnasium.make(ID, max_episode_steps=n),
    "by hand": lambda n: TimeLimit(TimeLimit(SlewEnv(), n), n + 5),
    "make_vec": lambda n: gymnasium.make_vec(ID, 1, max_episode_steps=n),
    "sync": lambda n: gymnasium.make_vec(ID, 1, "sync", max_episode_steps=n),
    "params": lambda n: gymnasium.make(
        ID,
        params=AttitudeEnv().default_params.replace(max_steps_in_episode=jnp.array(n, jnp.int32)),
    ),
}


def rewards_at_the_goal(env):
    """Rewards of one spacecraft that is at rest at the goal from its start."""
    env.reset(seed=0)
    task = env.unwrapped.envs[0].unwrapped if hasattr(env.unwrapped, "envs") else env.unwrapped
    shape = task._state.time.shape
    task._state = task._state.replace(
        quaternion=jnp.broadcast_to(jnp.array([0.0, 0.0, 0.0, 1.0]), (*shape, 4)),
        angular_velocity=jnp.zeros((*shape, 3)),
    )
    rewards, ended = [], False
    while not ended:
        _, reward, _, ended, _ = env.step(np.zeros(getattr(env, "num_envs", ()), int))
        rewards.append(np.asarray(reward).item())
    return rewards


@pytest.mark.parametrize("make", LIMITED.values(), ids=LIMITED)
@pytest.mark.parametrize("limit", [3, 520])
def test_the_last_reward_is_given_at_the_one_time_limit(make, limit):
    """Limits below and above the task's own, 500."""
    assert rewards_at_the_goal(make(limit)) == [9.0] * (limit - 1) + [50.0]


def test_the_tasks_own_limit_comes_back_with_the_next_reset():
    limited = gymnasium.make(ID, max_episode_steps=3)
    limited.reset()
    assert len(rewards_at_the_goal(limited.unwrapped)) == 500
    assert len(rewards_at_the_goal(limited)) == 3


@pytest.mark.parametrize("options, limit", [({}, 500), ({"frameskip": 5}, 1750)])
def test_the_spec_has_the_time_limit(options, limit):
    for make in (gymnasium.make, gymnasium.make_vec):
        for given, expected in (({}, limit), ({"max_episode_steps": 7}, 7)):
            env = make(ID, **options, **given)
            assert env.spec.max_episode_steps == expected
            again = make(env.spec)
            assert again.spec.max_episode_steps == expected
            assert again.unwrapped.metadata == env.unwrapped.metadata
    assert gymnasium.make(ID, max_episode_steps=-1).spec.max_episode_steps == 500
    assert gymnasium.make_vec(ID, max_episode_steps=-1).spec.max_episode_steps == 500


def test_info_has_success_and_scalars_of_numpy():
    env = gymnasium.make(ID, max_episode_steps=1)
    rewards_at_the_goal(env)
    env.reset(seed=0)
    *_, info = env.step(1)
    assert info["is_success"] == info["success_rate"] == 0
    assert {type(x) for x in info.values()} == {np.float32}
    envs = gymnasium.make_vec(ID, 2, max_episode_steps=1)
    envs.reset(seed=0)
    envs.unwrapped._state = envs.unwrapped._state.replace(
        quaternion=jnp.array([[0.0, 0, 0, 1], [1.0, 0, 0, 0]])
    )
    final = envs.step(np.zeros(2, int))[-1]["final_info"]
    assert final["is_success"].tolist() == final["success_rate"].tolist() == [1, 0]


@pytest.mark.parametrize("margin", [0.5, 0.99])
def test_masks_are_those_of_the_rate_mask(margin):
    own = AttitudeEnv()
    context = own.context(own.default_params)
    env = gymnasium.make(ID, rate_margin=margin)
    with pytest.raises(ResetNeeded):
        env.unwrapped.action_masks()
    env.reset(seed=0)
    assert env.unwrapped.action_masks().tolist() == [True] * 19
    envs = gymnasium.make_vec(ID, 3, rate_margin=margin)
    envs.reset(seed=0)
    rates = jnp.array([[0.0, 0, 0], [0.2495, 0, 0], [0.0, 0, -0.4945]])
    envs._state = envs._state.replace(angular_velocity=rates)
    masks = envs.action_masks()
    assert masks.shape == (3, 19) and masks.dtype == bool
    for i, rate in enumerate(rates):
        allowed = assurance.rate_mask(context, margin).allowed(rate)
        np.testing.assert_array_equal(masks[i], allowed)
        env.unwrapped._state = jax.tree.map(lambda x, i=i: jnp.array(x[i]), envs._state)
        np.testing.assert_array_equal(env.unwrapped.action_masks(), masks[i])
    assert masks[0].all() and not masks[2].all() and masks[1].all() == (margin == 0.99)


def test_the_module_may_be_named_in_the_id():
    code = f"import gymnasium; print(gymnasium.make('attjax.wrappers.gymnasium:{ID}').spec.id)"
    assert python(code).stdout.strip() == ID


ASYNC = """
import gymnasium, multiprocessing, sys
if __name__ == "__main__":
    {before}
    name = "attjax.wrappers.gymnasium:attjax/Slew-v0"
    envs = gymnasium.make_vec(name, 2, "async", vector_kwargs={{"context": "{context}"}})
    print(envs.reset(seed=[0, 1])[0].shape, envs.step([0, 1])[1].shape)
    envs.close()
"""


def python(code, tmp_path=None):
    """A process of its own; the limit is there for one that hangs."""
    where = ["-c", code]
    if tmp_path is not None:  # processes that are spawned import the program
        (tmp_path / "program.py").write_text(code)
        where = [str(tmp_path / "program.py")]
    return subprocess.run(
        [sys.executable, "-W", "ignore", *where],
        capture_output=True,
        text=True,
        timeout=300,
        env={"PYTHONPATH": str(ROOT), "PATH": "", "JAX_PLATFORMS": "cpu"},
    )


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
def test_a_forked_process_ends_in_one_line(tmp_path):
    result = python(ASYNC.format(before="pass", context="fork"), tmp_path)
    lines = [line for line in result.stderr.splitlines() if 'context="spawn"' in line]
    assert result.returncode != 0 and len(lines) == 2
    assert "Traceback" not in result.stderr.split(lines[0])[0]  # neither child shows one
    assert result.stderr.count("Traceback") == 1  # Gymnasium's own, of the parent


def test_spawned_processes_work(tmp_path):
    result = python(ASYNC.format(before="pass", context="spawn"), tmp_path)
    assert result.stdout.split("\n")[0] == "(2, 11) (2,)", result.stderr


FORK = """
import gymnasium, multiprocessing
import attjax.wrappers.gymnasium
{before}
def work():
    env = {make}
    env.reset(seed=0)
    print(env.step(0)[3], flush=True)
process = multiprocessing.get_context("fork").Process(target=work)
process.start()
process.join()
raise SystemExit(process.exitcode)
"""
MADE = "made = gymnasium.make('attjax/Slew-v0')"


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
@pytest.mark.parametrize(
    "before, make",
    [
        ("import jax; jax.numpy.zeros(3)", MADE.removeprefix("made = ")),
        (MADE, "made"),
        (f"{MADE}; made.reset()", "made"),
    ],
)
def test_whatever_is_used_after_a_fork_says_so(before, make):
    result = python(FORK.format(before=before, make=make))
    assert result.returncode == 1 and result.stdout == ""
    assert len(result.stderr.splitlines()) == 1 and 'context="spawn"' in result.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="there is no fork")
def test_a_fork_before_jax_is_used_works():
    result = python(FORK.format(before="", make=MADE.removeprefix("made = ")))
    assert (result.returncode, result.stdout) == (0, "False\n"), result.stderr
