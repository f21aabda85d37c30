"""What is timed, and how: every contender of training.py trains the same workload."""

import dataclasses
import json
import sys
import time
from collections.abc import Callable
from importlib.metadata import version

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
    """

    name: str
    workload: Workload
    prepare: Callable[[Workload], Callable[[], None]]


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
        for update, result in zip(updates, results):
            start, cpu_start = time.perf_counter(), time.process_time()
            update()
            result["cpu_s"].append(time.process_time() - cpu_start)
            result["update_s"].append(time.perf_counter() - start)
    return [with_rates(result) for result in results]


def with_rates(result: dict) -> dict:
    """The result with its agent-steps/s."""
    steps = result["num_envs"] * result["rollout_length"]
    return result | {"steps_per_s": summary([steps / s for s in result["update_s"]])}


def serve(name: str, packages: tuple[str, ...], prepare) -> None:
    """What a runner in another environment does: read workloads, print their results."""
    request, contenders = json.load(sys.stdin), []
    for values in request["workloads"]:
        values["hidden_sizes"] = tuple(values["hidden_sizes"])
        contenders.append(Contender(name, Workload(**values), prepare))
    versions = {"versions": {package: version(package) for package in packages}}
    print(json.dumps([versions | result for result in measure(contenders, request["repeats"])]))
