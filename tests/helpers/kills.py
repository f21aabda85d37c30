"""Kills train.py -9 at random instants, resumes it, and compares its end with a calm run's.

Each run is killed several times, then left to end. After each kill no checkpoint may be lost,
the newest must load, and the next start must go on from it. In the end all arrays of the
learner and all rows of metrics.csv but their clock must equal, to the bit, those of a run that
nobody disturbed.

With --continued it is a run that begins with the networks of another, ``--resume-from``.

Example:
    python tests/helpers/kills.py --kills 200 --jobs 2
"""

import argparse
import concurrent.futures
import csv
import os
import random
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
KILLS_A_RUN = 8
TRAIN = [
    sys.executable, str(ROOT / "train.py"), "--device=cpu", "--frameskips=5,20", "--num-envs=16",
    "--rollout-length=8", "--minibatch-size=32", "--hidden-sizes=16", "--updates-per-block=2",
    "--save-every=0", f"--total-steps={100 * 16 * 8}", "--resume",
]  # fmt: skip
"""Small blocks, saved each: most of the time after compilation goes into saving."""


def main(argv=None) -> int:
    """Run the campaign; returns 0 if all went well."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("--seed", type=int, default=0, help="of the instants")
    parser.add_argument("--continued", action="store_true", help="a run that begins with another's")
    arguments = parser.parse_args(argv)
    runs = -(-arguments.kills // KILLS_A_RUN)
    with tempfile.TemporaryDirectory() as scratch:
        more = _begun_from(Path(scratch) / "other") if arguments.continued else []
        calm = Run(Path(scratch) / "calm", random.Random(0), more)
        calm.finish()
        expected = calm.result()

        def disturbed(number):
            kills = min(KILLS_A_RUN, arguments.kills - number * KILLS_A_RUN)
            instants = random.Random(f"{arguments.seed}/{number}")
            run = Run(Path(scratch) / str(number), instants, more)
            report = run.disturb(kills)
            run.finish()
            same = equal(run.result(), expected)
            print(f"run {number}: {report}; its end is {'the same' if same else 'ANOTHER'}")
            return kills, same

        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            results = list(pool.map(disturbed, range(runs)))
    kills, same = sum(kills for kills, _ in results), sum(same for _, same in results)
    print(f"{kills} of {kills} kills resumed, no checkpoint lost; {same} of {runs} ends the same")
    return 0 if same == runs else 1


def _begun_from(folder):
    """The flags of a run on another spacecraft, from a first one that is trained here."""
    other = Run(folder, random.Random(0), ["--seed=1", "--total-steps=2560"])
    other.finish()
    craft = ROOT / "docs" / "examples" / "lm50-doubled.toml"
    return [f"--resume-from={folder}", f"--spacecraft={craft}"]


class Run:
    """A training run that can be killed, with more flags than TRAIN."""

    def __init__(self, folder: Path, instants: random.Random, more: list[str]):
        self._folder, self._instants, self._newest = folder, instants, -1
        self._more = more

    def disturb(self, kills: int) -> str:
        """Kill it that often; returns where it stood then.

        Raises:
            AssertionError: something was lost, or it did not go on.
        """
        stood = [self._killed() for _ in range(kills)]
        return f"killed at updates {', '.join('–' if n < 0 else str(n) for n in stood)}"

    def finish(self) -> None:
        """Go on to the end."""
        with self._start() as process:
            output = process.stdout.read()
        assert process.returncode == 0, output
        self._check_goes_on(output)
        left = [path.name for path in self._folder.iterdir() if path.name.startswith(".")]
        assert not left, f"{left} is left behind"

    def result(self) -> tuple[dict, list]:
        """All arrays of the newest checkpoint by name, and the metrics but the clock."""
        import orbax.checkpoint as ocp

        from attjax.runs import checkpoint

        path = self._folder / str(checkpoint.latest(self._folder)) / "learner"
        with ocp.PyTreeCheckpointer() as checkpointer:
            tree = checkpointer.restore(path.absolute())
        with (self._folder / "metrics.csv").open(newline="") as file:
            rows = [{k: v for k, v in row.items() if k != "wall_s"} for row in csv.DictReader(file)]
        return flat(tree), rows

    def _start(self):
        command = [*TRAIN, *self._more, "--checkpoint", str(self._folder)]
        environment = os.environ | {"PYTHONUNBUFFERED": "1"}
        return subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment
        )

    def _killed(self) -> int:
        """Start and kill it: mostly between two blocks or while it saves, at times before."""
        with self._start() as process:
            output = ""
            if self._instants.random() < 0.25:
                time.sleep(self._instants.uniform(0, 5))
            else:
                for line in process.stdout:
                    output += line
                    if line.startswith("compiled"):
                        break
                time.sleep(self._instants.uniform(0, 3))
            process.kill()
            output += process.stdout.read()
        self._check_goes_on(output)
        return self._check_nothing_lost()

    def _check_goes_on(self, output):
        """Had it come so far, it went on from the newest checkpoint, without an error."""
        assert "train.py: error" not in output and "Traceback" not in output, output
        if "compiled" in output and self._newest > 0:
            assert f"resumed at {self._newest * 128:,} agent steps" in output, output

    def _check_nothing_lost(self):
        from attjax.runs import checkpoint

        if not (self._folder / "config.json").exists():
            return -1
        newest = checkpoint.latest(self._folder)
        newest = -1 if newest is None else newest
        assert newest >= self._newest, f"checkpoint {self._newest} is lost: {newest} is the newest"
        if newest >= 0:
            checkpoint.restore_policy(self._folder)
        self._newest = newest
        return newest


def flat(tree, prefix="") -> dict[str, np.ndarray]:
    """Arrays of nested dictionaries and lists by their path."""
    if isinstance(tree, dict | list | tuple):
        items = tree.items() if isinstance(tree, dict) else enumerate(tree)
        return {k: v for name, x in items for k, v in flat(x, f"{prefix}/{name}").items()}
    return {prefix: np.asarray(tree)}


def equal(a, b) -> bool:
    """Whether two results are the same to the bit."""
    (arrays, rows), (others, other_rows) = a, b
    return (
        rows == other_rows
        and arrays.keys() == others.keys()
        and all(arrays[k].tobytes() == others[k].tobytes() for k in arrays)
    )


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    sys.exit(main())
