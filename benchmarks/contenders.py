"""What is timed, and how: every contender of training.py trains the same workload."""

import contextlib
import dataclasses
import functools
import json
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from common import summary


@dataclasses.dataclass(frozen=True)
class Workload:
    """One update: a rollout, then passes of shuffled minibatches over it."""

    hidden_sizes: tuple[int, ...]
    num_envs: int
    rollout_length: int
    passes: int
    minibatch_size: int

    @property
    def steps(self) -> int:
        """Agent steps of an update."""
        return self.num_envs * self.rollout_length

    @property
    def minibatches(self) -> int:
        """Gradient steps of a pass."""
        return self.steps // self.minibatch_size


@dataclasses.dataclass(frozen=True)
class Contender:
    """A trainer of a workload.

    Attributes:
        name: as in the table.
        workload: what it trains.
        prepare: function of the workload that builds and compiles, and returns a function
            without arguments that runs one update to its end.
        processor_s: seconds that the trainer has had the processor for.
    """

    name: str
    workload: Workload
    prepare: Callable[[Workload], Callable[[], None]]
    processor_s: Callable[[], float] = time.process_time


def measure(contenders: list[Contender], repeats: int) -> list[dict]:
    """Seconds of ``repeats`` updates of each contender, taking turns, after one untimed.

    Seconds of the processor's time beside those of the clock show whether others used the core.
    """
    results, updates = [], []
    for contender in contenders:
        start = time.perf_counter()
        update = contender.prepare(contender.workload)
        compile_s = time.perf_counter() - start
        update()
        updates.append(update)
        described = {"name": contender.name} | dataclasses.asdict(contender.workload)
        results.append(described | {"compile_s": compile_s, "update_s": [], "cpu_s": []})
    for _ in range(repeats):
        for contender, update, result in zip(contenders, updates, results):
            start, cpu_start = time.perf_counter(), contender.processor_s()
            update()
            result["cpu_s"].append(contender.processor_s() - cpu_start)
            result["update_s"].append(time.perf_counter() - start)
    return [with_rates(result) for result in results]


def with_rates(result: dict) -> dict:
    """The result with its agent-steps/s."""
    steps = result["num_envs"] * result["rollout_length"]
    return result | {"steps_per_s": summary([steps / s for s in result["update_s"]])}


class PeerError(Exception):
    """A peer's process ended; the message is its last line."""


class Peer:
    """A trainer in a process of its own, with another interpreter, that works when it is asked."""

    def __init__(self, python: str, *runner: str | Path):
        """Start the runner, a script that calls :func:`serve`, with its arguments.

        Raises:
            PeerError: the interpreter or a package is missing.
        """
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        try:
            self._process = subprocess.Popen([python, *runner], text=True, **pipes)
        except OSError as error:
            raise PeerError(f"{python}: {error.strerror}") from None
        self.versions = self._ask("versions")

    def prepare(self, workload: Workload) -> Callable[[], None]:
        """As a :class:`Contender`'s."""
        number = self._ask("prepare", dataclasses.asdict(workload))
        return functools.partial(self._ask, "update", number)

    def processor_s(self) -> float:
        """As a :class:`Contender`'s."""
        return self._ask("processor_s")

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()

    def _ask(self, what, argument=None):
        with contextlib.suppress(BrokenPipeError):  # it has ended, and there will be no reply
            self._process.stdin.write(json.dumps([what, argument]) + "\n")
            self._process.stdin.flush()
        reply = self._process.stdout.readline()
        if not reply:
            lines = self._process.stderr.read().strip().splitlines()
            raise PeerError((lines or ["no message"])[-1])
        return json.loads(reply)


def serve(packages: tuple[str, ...], prepare) -> None:
    """What a :class:`Peer`'s script does: as it is asked, line by line.

    Args:
        packages: whose versions are told.
        prepare: as a :class:`Contender`'s.
    """
    replies, sys.stdout = sys.stdout, sys.stderr
    updates = []

    def prepare_one(values):
        sizes = tuple(values.pop("hidden_sizes"))
        updates.append(prepare(Workload(sizes, **values)))
        return len(updates) - 1

    answers = {
        "versions": lambda _: {package: version(package) for package in packages},
        "prepare": prepare_one,
        "update": lambda number: updates[number](),
        "processor_s": lambda _: time.process_time(),
    }
    for line in sys.stdin:
        what, argument = json.loads(line)
        print(json.dumps(answers[what](argument)), file=replies, flush=True)
