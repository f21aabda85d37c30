"""Seconds from the start of train.py until its greedy policy is good, by recipe.

Good is (a) a greedy return of 2,500 at frameskip 20, the paper's plateau, and (b) all of the
paper's Table 2 but its minima, which are single draws, beaten at 40 Hz. train.py runs as a
process of its own, with an empty compile cache; it saves a checkpoint every few seconds, which
counts, and stands still while the newest is evaluated, which does not.

Needs the extra plot for ``--plot``.

Example:
    python benchmarks/time_to_quality.py --limit 600 --plot time_to_quality.png
"""

import contextlib
import dataclasses
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import common

from attjax import errors

ROOT = Path(__file__).resolve().parents[1]
PLATEAU = 2500
RECIPES = {
    "precise": ["--preset", "precise"],
    "paper-fast": ["--preset", "paper-fast"],
    "paper-fast, multiscale 64-64": [
        "--preset", "paper-fast", "--features", "multiscale", "--hidden-sizes", "64,64",
        "--num-envs", "256", "--rollout-length", "64", "--minibatch-size", "1024",
        "--learning-rate", "2e-3", "--total-steps", "3000000", "--passes", "4",
        "--gae-lambda", "0.95", "--greedy-share", "0", "--near-goal-share", "0",
        "--rate-margin", "0", "--time-limit-terminates",
    ],
    "paper": ["--preset", "paper"],
}  # fmt: skip


@dataclasses.dataclass(frozen=True)
class Point:
    """The greedy policy at one time of a run; errors in degrees, at 40 Hz."""

    seconds: float
    agent_steps: int
    episode_return: float
    mean_error: float
    max_error: float
    reaches_plateau: bool
    beats_table_2: bool


def parse_arguments(argv=None):
    """The command line."""
    parser = common.parser(__doc__)
    plot_help = "also draw the curves (PNG)"
    parser.add_argument("--plot", type=common.writable_file, metavar="FILE", help=plot_help)
    recipes_help = "these only (default: all)"
    parser.add_argument("--recipes", nargs="+", choices=RECIPES, default=RECIPES, help=recipes_help)
    parser.add_argument("--limit", type=float, default=600, help="seconds for each recipe")
    parser.add_argument("--every", type=float, default=5, help="seconds between evaluations")
    parser.add_argument("--episodes", type=int, default=1000, help="slews of an evaluation")
    parser.add_argument("--seed", type=int, default=0, help="of the training")
    return parser.parse_args(argv)


@errors.program("time_to_quality.py")
def main(argv=None) -> int:
    """Train all recipes and print the table."""
    arguments = parse_arguments(argv)
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    machine, curves = common.machine(), {}
    common.print_machine(machine)
    for name in arguments.recipes:
        curves[name] = learning_curve(name, arguments)
        points = {name: [dataclasses.asdict(p) for p in curve] for name, curve in curves.items()}
        common.write_json(arguments.json, {"machine": machine, "curves": points})
    print_table(curves)
    if arguments.plot:
        import quality_plot

        quality_plot.plot(curves, PLATEAU, arguments.plot)
    return 0


def learning_curve(name: str, arguments) -> list[Point]:
    """Train a recipe to its end or to the limit, evaluating on the way."""
    from attjax.runs import checkpoint

    curve, looked_at = [], None
    with training(name, arguments) as run:
        examiner = Examiner(run.folder, arguments.episodes)
        running = True
        while running and run.seconds < arguments.limit:
            running = run.process.poll() is None
            newest = checkpoint.latest(run.folder) if run.folder.exists() else None
            if newest != looked_at and (not running or is_due(run.seconds, curve, arguments.every)):
                looked_at = newest
                with run.paused():
                    curve.append(examiner.point(run.seconds))
                print(f"{name}: {curve[-1]}", flush=True)
            time.sleep(0.2)
        if not running and run.process.returncode != 0:
            sys.exit(f"train.py failed: see {run.log.read_text()}")
    return curve


def is_due(seconds, curve, every) -> bool:
    """Whether it is time for another evaluation; late ones are spaced by 2 % of the time."""
    return not curve or seconds > curve[-1].seconds + max(every, 0.02 * seconds)


@contextlib.contextmanager
def training(name: str, arguments):
    """train.py in a fresh folder, ended and removed in the end."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, log = Path(scratch) / "run", Path(scratch) / "log"
        flags = [*RECIPES[name], "--seed", str(arguments.seed), "--checkpoint", str(folder)]
        flags += ["--save-every", str(arguments.every)]
        with log.open("w") as output:
            start = time.monotonic()
            process = subprocess.Popen(
                [sys.executable, "train.py", *flags],
                cwd=ROOT,
                env=os.environ | {"XDG_CACHE_HOME": scratch},
                stdout=output,
                stderr=subprocess.STDOUT,
            )
        try:
            yield Run(process, folder, log, start)
        finally:
            process.terminate()
            process.wait()


class Run:
    """A training process whose clock stands still while it does."""

    def __init__(self, process, folder: Path, log: Path, start: float):
        self.process, self.folder, self.log = process, folder, log
        self._start, self._stopped_at = start, None

    @property
    def seconds(self) -> float:
        """Since the start, without the pauses."""
        return (self._stopped_at or time.monotonic()) - self._start

    @contextlib.contextmanager
    def paused(self):
        """Keep the process still."""
        self.process.send_signal(signal.SIGSTOP)
        self._stopped_at = time.monotonic()
        try:
            yield
        finally:
            self._start += time.monotonic() - self._stopped_at
            self._stopped_at = None
            self.process.send_signal(signal.SIGCONT)


class Examiner:
    """Flies the newest policy of a run over the same slews each time."""

    def __init__(self, folder: Path, episodes: int):
        self._folder, self._episodes, self._act = folder, episodes, None

    def point(self, seconds: float) -> Point:
        """The newest policy's figures."""
        import jax

        from attjax.runs import checkpoint
        from attjax.runs import folder as run_folder

        update = checkpoint.latest(self._folder)
        policy = checkpoint.restore_policy(self._folder)
        # One function object for all checkpoints, or each would be compiled for anew.
        self._act = self._act or policy.func
        policy = jax.tree_util.Partial(self._act, *policy.args)
        at_11_hz, at_40_hz = (self._statistics(policy, frameskip) for frameskip in (20, 5))
        mean_return = at_11_hz["episode_return"]["mean"]
        settings = run_folder.read_config(self._folder).settings
        return Point(
            seconds=round(seconds, 1),
            agent_steps=update * settings.ppo.steps_per_update,
            episode_return=mean_return,
            mean_error=at_40_hz["terminal"]["error_deg"]["mean"],
            max_error=at_40_hz["terminal"]["error_deg"]["max"],
            reaches_plateau=mean_return >= PLATEAU,
            beats_table_2=beats_table_2(at_40_hz),
        )

    def _statistics(self, policy, frameskip):
        import jax

        from attjax import AttitudeEnv, evaluation

        env = AttitudeEnv(frameskip)
        params = env.default_params
        flown = evaluation.fly(policy, env, params, jax.random.key(0), self._episodes)
        return evaluation.statistics(flown, env, params)


def beats_table_2(statistics: dict) -> bool:
    """Whether all statistics of error and rate, but the minima, are below the paper's."""
    from attjax.evaluation import STATISTICS
    from attjax.evaluation.paper import PAPER_TABLE_2

    return all(
        statistics[state][quantity][name] < paper
        for (state, quantity), row in PAPER_TABLE_2.items()
        for name, paper in zip(STATISTICS, row)
        if name != "min"
    )


def print_table(curves: dict) -> None:
    """When each recipe first reached what."""
    rows = []
    for name, curve in curves.items():
        cells = []
        for criterion in ("reaches_plateau", "beats_table_2"):
            point = next((point for point in curve if getattr(point, criterion)), None)
            never = f"never within {curve[-1].seconds:.0f}" if curve else "no checkpoint"
            cells += [f"{point.seconds:.0f}", f"{point.agent_steps:,}"] if point else [never, "–"]
        best = min((point.mean_error for point in curve), default=float("nan"))
        rows.append([name, *cells, f"{best:.3g}"])
    columns = [f"return\n{PLATEAU:,} (s)", "\nsteps", "Table 2\nbeaten (s)", "\nsteps"]
    common.print_table(["", *columns, "least mean\nerror (°)"], rows)


if __name__ == "__main__":
    sys.exit(main())
