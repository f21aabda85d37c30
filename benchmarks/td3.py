"""TD3 on continuous torques, as the paper's predecessor [13] trained it, by rejax.

Networks and numbers are the predecessor's (see td3_learner.py), the environment the paper's with
continuous actions: 11.43 Hz, 500 steps. Prints a row of greedy slews as it goes, and keeps the
actor as a run's policy, for eval.py, beside the learner's state, from which ``--resume`` of this
program goes on.

    python -m venv rejax && rejax/bin/pip install --editable . rejax

Example:
    rejax/bin/python benchmarks/td3.py --reward paper --seed 0 --steps 500000 --out runs/td3
    python eval.py --checkpoint runs/td3
"""

import importlib
import os
import sys
from pathlib import Path

from attjax import errors
from attjax.config import command_line, fields
from attjax.config.command_line import add_number

REWARDS = ("paper", "binary", "authors-continuous", "logarithmic")
STATE, CURVE = "td3.npz", "curve.csv"
COLUMNS = "agent_steps", "greedy_return", "success_rate", "overspeed_rate", "terminal_error_deg"
DIVERGED = 3


def parse_arguments(argv=None):
    """The command line."""
    parser = command_line.Parser(description=__doc__)
    parser.add_argument("--reward", choices=REWARDS, default="paper", help="(default: paper)")
    add_number(parser, "reward-scale", float, 1.0, "factor of the reward", above=0)
    add_number(parser, "seed", int, 0, "of networks, exploration and episodes", **fields.SEED)
    add_number(parser, "steps", int, 500_000, "agent steps in all", low=1)
    add_number(parser, "every", int, 10_000, "agent steps between two rows, each saved", low=1)
    add_number(parser, "slews", int, 200, "greedy slews of a row", low=1)
    out_help = "folder of the run"
    parser.add_argument("--out", type=command_line.path, required=True, help=out_help)
    limit_help = "learn the time limit as an end; without it, what comes after counts"
    parser.add_argument("--time-limit-terminates", action="store_true", help=limit_help)
    parser.add_argument("--resume", action="store_true", help="go on with the folder's run")
    arguments = parser.parse_args(argv)
    if (arguments.out / STATE).exists() != arguments.resume:
        there = "holds a run: pass --resume" if not arguments.resume else "holds no run to resume"
        parser.error(f"--out {arguments.out} {there}, or another folder")
    return arguments


@errors.program("td3.py")
def main(argv=None) -> int:
    """Train, and print the curve."""
    arguments = parse_arguments(argv)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    with errors.one_line_errors():
        try:
            learners = importlib.import_module("td3_learner")
        except ModuleNotFoundError as error:
            raise errors.UserError(f"{error.name} is missing; see --help") from None
        return train(learners, arguments)


def train(learners, arguments) -> int:
    """Train to the last step, a row and a saved state every so often."""
    from attjax import AttitudeEnv
    from attjax.envs.reward import REWARDS as functions
    from attjax.runs import checkpoint
    from attjax.runs import folder as run_folder

    env = AttitudeEnv(20, functions[arguments.reward], actions="continuous")
    task = learners.Task(env, arguments.reward_scale, arguments.time_limit_terminates)
    learner = learners.Learner(task, arguments.seed)
    with run_folder.opened(arguments.out):
        begin(arguments, learner, config(learners, arguments))
        print(*COLUMNS, flush=True)
        with checkpoint.Saver(arguments.out) as saver:
            while learner.agent_steps < arguments.steps:
                learner.advance(min(learner.agent_steps + arguments.every, arguments.steps))
                row = judged(learner.controller(), env, arguments.slews)
                if not all(abs(value) < float("inf") for value in row):
                    errors.error_line(f"NaN after {learner.agent_steps} agent steps")
                    return DIVERGED
                cells = [str(learner.agent_steps), *(f"{value:.6g}" for value in row)]
                print(*cells, flush=True)
                saver.save(learners.as_run(learner), terminal_error=row[-1])
                save(arguments.out, learner, cells)
    return 0


def config(learners, arguments):
    """What config.json says of the run: its task and its network, and what PPO has a name for."""
    from attjax.config.presets import PAPER
    from attjax.config.run import Config

    settings = PAPER.replace(
        reward=arguments.reward,
        reward_scale=arguments.reward_scale,
        time_limit_terminates=arguments.time_limit_terminates,
        actions="continuous",
        hidden_sizes=learners.HIDDEN_SIZES,
        total_steps=arguments.steps,
        num_envs=learners.NUM_ENVS,
        rollout_length=1,
        passes=1,
        minibatch_size=learners.NUM_ENVS,
        discount=learners.NUMBERS["gamma"],
        learning_rate=learners.NUMBERS["learning_rate"],
        final_learning_rate=learners.NUMBERS["learning_rate"],
    )
    return Config("td3", arguments.seed, settings)


def begin(arguments, learner, config) -> None:
    """Make the folder a run's, or go on from its state.

    Raises:
        UserError: its run has another reward, scale, end or seed.
    """
    import dataclasses

    from attjax.runs import folder as run_folder

    if not arguments.resume:
        run_folder.create(arguments.out, config, overwrite=False)
        return
    old = run_folder.read_config(arguments.out)
    settings = old.settings.replace(total_steps=arguments.steps)
    if dataclasses.replace(old, settings=settings) != config:
        kept = "--reward, --reward-scale, --time-limit-terminates and --seed"
        raise errors.UserError(f"--resume keeps the run's {kept}")
    run_folder.write_config(arguments.out, config)
    learner.state = restored(arguments.out / STATE, learner.state)


def judged(controller, env, slews: int) -> list[float]:
    """Return of Eq. 12–13, success, overspeed and terminal error of greedy slews."""
    import jax
    import jax.numpy as jnp

    from attjax.evaluation import episodes

    params = env.default_params
    flown = episodes.fly(controller, env, params, jax.random.key(10**6), slews)
    inside = ~flown.overspeed & (flown.terminal_angle <= params.goal_angle)
    figures = flown.score, inside, flown.overspeed, jnp.rad2deg(flown.terminal_angle)
    return [float(jnp.mean(figure)) for figure in figures]


def save(folder: Path, learner, cells: list[str]) -> None:
    """Add a row to the curve, and replace the state in one step."""
    import jax
    import numpy as np

    curve = folder / CURVE
    if not curve.exists():
        curve.write_text(",".join(COLUMNS) + "\n")
    with curve.open("a") as file:
        file.write(",".join(cells) + "\n")
    temporary = folder / f"new_{STATE}"
    np.savez(temporary, *jax.tree.leaves(learner.state))
    os.replace(temporary, folder / STATE)


def restored(path: Path, state):
    """The saved state, shaped like this one."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    with np.load(path) as saved:
        leaves = [jnp.array(saved[f"arr_{index}"]) for index in range(len(saved.files))]
    return jax.tree.unflatten(jax.tree.structure(state), leaves)


if __name__ == "__main__":
    sys.exit(main())
