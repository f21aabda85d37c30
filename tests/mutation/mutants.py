"""Breaks the code on purpose, a change at a time in a copy, and tells which test sees it first.

The changes are cosmic-ray's to the modules of ``[tool.mutants]`` in pyproject.toml, and those of
faults.py, which no rule makes. A change that no test sees is an error, unless
equivalent_mutants.toml says why there is nothing to see.

Cosmic-ray makes the changes but does not run the tests: a process that imports JAX anew for each
takes several times as long as a fork of one that did.

Example:
    python tests/mutation/mutants.py --modules losses reward
    python tests/mutation/mutants.py --modules faults
"""

import argparse
import collections
import importlib
import json
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import tomllib
from pathlib import Path

import cosmic_ray.plugins
from cosmic_ray.mutating import mutate_code
from faults import FAULTS
from operators import OPERATORS, SwapNames

ROOT = Path(__file__).resolve().parents[2]
TESTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["mutants"]
EQUIVALENT = tomllib.loads((ROOT / "tests/mutation/equivalent_mutants.toml").read_text())

PRELOADED = [
    "chex", "flax.linen", "hypothesis", "jax", "jax.test_util", "numpy", "optax",
    "orbax.checkpoint", "pytest", "rich.live", "scipy.integrate", "scipy.spatial", "scipy.special",
]  # fmt: skip
"""What tests import and no change touches; none of it starts JAX's threads."""

TIME_LIMIT = 300
"""Seconds of processor time after which a change is taken to be seen: it hangs."""

Mutant = collections.namedtuple("Mutant", "module name source line becomes tests")


def options(argv) -> argparse.Namespace:
    """What the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--modules", nargs="+", choices=[*TESTS, "faults"], help="of these only")
    parser.add_argument("--only", default="", help="a pattern of names or lines")
    parser.add_argument("--jobs", type=int, default=2, help="test processes")
    parser.add_argument(
        "--log", type=Path, help="JSON lines; what an earlier run there saw is not tried again"
    )
    return parser.parse_args(argv)


def main(argv=None) -> int:
    """Try the changes; returns 1 if one was not seen."""
    chosen = options(argv)
    modules = chosen.modules or [*TESTS, "faults"]
    mutants = [x for name in modules for x in (faults() if name == "faults" else changes(name))]
    mutants = [x for x in mutants if re.search(chosen.only, f"{x.name} {x.line}")]
    known = {key(x): "equivalent" for x in mutants if is_equivalent(x)}
    if chosen.log and chosen.log.exists():
        results = map(json.loads, chosen.log.read_text().splitlines())
        known |= {tuple(x["key"]): x["outcome"] for x in results if x["outcome"] != "survived"}
    for name in PRELOADED:
        importlib.import_module(name)
    todo = [x for x in mutants if key(x) not in known]
    check_tests(todo)
    for mutant, outcome, caught_by in run(todo, chosen.jobs):
        known[key(mutant)] = outcome
        print(f"{outcome:9} {mutant.module}: {mutant.line}  ->  {mutant.becomes}  {caught_by}")
        sys.stdout.flush()
        if chosen.log:
            entry = {"key": key(mutant), "outcome": outcome, "caught_by": caught_by}
            with chosen.log.open("a") as log:
                log.write(json.dumps(entry) + "\n")
    kinds = ("killed", "hung", "broken", "equivalent", "survived")
    print("| module | mutants |", " | ".join(kinds), "|")
    counts = collections.Counter((x.module, known[key(x)]) for x in mutants)
    for module in dict.fromkeys(x.module for x in mutants):
        numbers = [counts[module, kind] for kind in kinds]
        print("|", module, "|", sum(numbers), "|", " | ".join(map(str, numbers)), "|")
    return 1 if "survived" in known.values() else 0


def check_tests(mutants) -> None:
    """End the program if the tests fail on the code as it is, since they would on any change."""
    for module, tests in {x.module: x.tests for x in mutants}.items():
        text = (ROOT / module).read_text()
        unchanged = Mutant(module, "", text, "", "", tests)
        for _, outcome, failed in run([unchanged], 1):
            if outcome != "survived":
                sys.exit(f"the tests of {module} fail on the code as it is: {failed}")


def key(mutant) -> tuple[str, str, str]:
    """What a mutant is known by in the log; the same from one state of the code to the next."""
    return mutant.module, mutant.name, f"{mutant.line} -> {mutant.becomes}"


def is_equivalent(mutant) -> bool:
    """Whether equivalent_mutants.toml lists it, or the part of the line that was changed."""
    return any(
        mutant.becomes.count(x["becomes"]) == 1
        and mutant.becomes.replace(x["becomes"], x["line"]) == mutant.line
        for x in EQUIVALENT.get(Path(mutant.module).stem, [])
    )


def faults() -> list[Mutant]:
    """The changes of faults.py."""
    found = []
    for name, (module, code, broken, tests) in FAULTS.items():
        text = (ROOT / module).read_text()
        assert text.count(code) == 1, f"{code!r} is {text.count(code)} times in {module}"
        text = text.replace(code, broken)
        found.append(Mutant(module, name, text, name, broken, tests))
    return found


def changes(module) -> list[Mutant]:
    """What the operators make of a module; each changed text once."""
    tests = TESTS[module]
    path = tests[0]
    text = (ROOT / path).read_text()
    operators = {name: cosmic_ray.plugins.get_operator(f"core/{name}")() for name in OPERATORS}
    found = {}
    for name, operator in (operators | {"SwapNames": SwapNames()}).items():
        occurrence = 0
        while (changed := mutate_code(text, operator, occurrence)) is not None:
            removed, added = difference(text, changed)
            found[changed] = Mutant(path, f"{name}-{occurrence}", changed, removed, added, tests)
            occurrence += 1
    return list(found.values())


def difference(before, after) -> tuple[str, str]:
    """The lines that were changed, and what they became."""
    old, new = before.splitlines(), after.splitlines()
    while old and new and old[0] == new[0]:
        del old[0], new[0]
    while old and new and old[-1] == new[-1]:
        del old[-1], new[-1]
    return " ".join(map(str.strip, old)), " ".join(map(str.strip, new))


def run(mutants, jobs):
    """Yield each mutant, its outcome and the test that saw it, ``jobs`` at a time."""
    waiting, running = collections.deque(mutants), {}
    with tempfile.TemporaryDirectory() as scratch:
        os.environ |= {
            "PYTHONDONTWRITEBYTECODE": "1",  # within a second two mutants look the same to Python
            "JAX_COMPILATION_CACHE_DIR": f"{scratch}/cache",
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
        }
        copies = [Path(scratch) / str(i) for i in range(jobs)]
        for copy in copies:
            leave_out = shutil.ignore_patterns(".git", ".venv*", "__pycache__", "ckpt", "docs")
            shutil.copytree(ROOT, copy, ignore=leave_out)
        while waiting or running:
            while waiting and copies:
                copy, mutant = copies.pop(), waiting.popleft()
                path = copy / mutant.module
                original = path.read_text()
                path.write_text(mutant.source)
                running[start(copy, mutant.tests)] = copy, mutant, path, original
            process, status = os.wait()
            copy, mutant, path, original = running.pop(process)
            path.write_text(original)
            copies.append(copy)
            yield mutant, *outcome(status, (copy / "output").read_text(errors="replace"))


def start(copy, tests) -> int:
    """A fork that runs the tests in the copy until one fails; its process id."""
    process = os.fork()
    if process:
        return process
    resource.setrlimit(resource.RLIMIT_CPU, (TIME_LIMIT, TIME_LIMIT))
    signal.alarm(10 * TIME_LIMIT)  # for one that waits
    sys.dont_write_bytecode = True
    sys.path.remove(str(ROOT / "tests" / "mutation"))
    del sys.modules["faults"]
    os.chdir(copy)
    os.environ["PYTHONPATH"] = str(copy)
    output = os.open("output", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    import pytest

    code = pytest.main(["-x", "-p", "no:cacheprovider", "--tb=line", *tests])
    sys.stdout.flush()
    os._exit(code)


def outcome(status, output) -> tuple[str, str]:
    """What became of a mutant, and the first test that failed."""
    if os.WIFSIGNALED(status):
        name = signal.Signals(os.WTERMSIG(status)).name
        return ("hung" if name in ("SIGALRM", "SIGXCPU", "SIGKILL") else "killed"), name
    code = os.WEXITSTATUS(status)
    failed = re.findall(r"^FAILED (\S+)", output, re.MULTILINE)
    if code == 0:
        return "survived", ""
    return ("killed", failed[0]) if code == 1 and failed else ("broken", f"exit status {code}")


if __name__ == "__main__":
    sys.exit(main())
