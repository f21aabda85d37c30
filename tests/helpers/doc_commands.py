"""The commands of the documentation: which kinds there are, and how each is checked and run.

In a code block, where that takes no network, peer or minutes, it is checked and run: shortened, on
CPU, in a folder like a clone. A command within the text is only checked.
"""

import contextlib
import functools
import io
import itertools
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import markdown
from commands import ROOT, STEPS_PER_UPDATE, TINY, eval_script, export_script, train_script
from packaging.requirements import Requirement

from attjax.runs import folder as run_folder

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
SHORT = [flag for flag in TINY if not flag.startswith("--frameskips")]
PEERS = ("torch", "stable-baselines3", "gymnax", "rejax", "tensorboard")
CAMPAIGNS = ("tests/helpers/exported.py", "tests/helpers/kills.py", "tests/mutation/mutants.py")
NO_FLAG = "--no-flag-of-any-script"


class Unknown(Exception):
    """A command of a kind that no test knows."""


def check(words: list[str]) -> None:
    """See that the programs know these flags and values."""
    for part in _parts(words):
        kind, arguments = _kind(part)
        CHECKS.get(kind, lambda _: None)(arguments)


def run(words: list[str]) -> None:
    """Check a command line; run, in the current folder, what can be run here."""
    if ">" in words:
        *words, arrow, file = words
        assert arrow == ">", words
        with Path(file).open("w") as output, contextlib.redirect_stdout(output):
            run(words)
        return
    check(words)
    for part in _parts(words):
        kind, arguments = _kind(part)
        if "--help" not in arguments:
            RUNS.get(kind, lambda _: None)(arguments)


@functools.cache
def known_flags() -> set[str]:
    """The flags of train.py, eval.py, export.py and of the scripts beside them."""
    text = io.StringIO()
    for script in (train_script, eval_script, export_script):
        with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
            script.parse_arguments(["--help"])
    scripts = [*ROOT.glob("benchmarks/*.py"), *map(ROOT.joinpath, CAMPAIGNS)]
    sources = [path.read_text() for path in scripts]
    help_text = re.sub(r"--\[no-\]([\w-]+)", r"--\1 --no-\1", text.getvalue())
    added = r'"(--[a-z][\w-]*)"', r'add_number\(\s*\w+,\s*"([a-z][\w-]*)"'
    found = (re.findall(pattern, source) for pattern in added for source in sources)
    flags = ("--" + flag.removeprefix("--") for flag in itertools.chain(*found))
    return {*re.findall(r"--[a-z][\w-]*", help_text), *flags}


def python_process(*words: str, timeout: float = 120) -> subprocess.CompletedProcess:
    """Run a script of the repository, from its root, as a process."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, *words],
        capture_output=True, text=True, timeout=timeout, env=environment, cwd=ROOT,
    )  # fmt: skip


def with_values(code: str) -> list[str] | None:
    """The words of a command in the text, its placeholders replaced; None if it is no command.

    A script's name alone, or with a flag, names the script or the flag.
    """
    if not code.startswith(("python ", "make ", "pip ", "cc ")):
        return None
    return [re.sub(r"^([A-Z]+|…)$", "1", word) for word in markdown.split(code)]


def _parts(words):
    """The commands between ``&&``."""
    parts = [[]]
    for word in words:
        if word == "&&":
            parts.append([])
        else:
            parts[-1].append(word)
    return parts


def _kind(words):
    """What sort of command it is, and its arguments."""
    program, arguments = words[0], words[1:]
    if program.endswith("/pip"):
        program = "pip"
    if program.endswith(("/python", "python3")):
        program = "python"
    if program == "python" and arguments:
        program, arguments = arguments[0], arguments[1:]
        if program == "-m" and arguments:
            program, arguments = f"-m {arguments[0]}", arguments[1:]
    if re.fullmatch(r"(benchmarks|tests|docs)/(\w+/)?\w+\.py", program):
        return "script", [program, *arguments]
    if program.startswith("./"):
        return "own program", words
    if program not in CHECKS.keys() | RUNS.keys():
        raise Unknown(f"{' '.join(words)}: no kind of command that doc_commands.py knows")
    return program, arguments


def _check_arguments(script, arguments):
    if "--help" not in arguments:
        script.parse_arguments(arguments)


def _check_script(words):
    """Flags and values, without running it: a flag that is certainly wrong is all that is."""
    script, *arguments = words
    assert (ROOT / script).is_file(), script
    result = python_process(script, *arguments, NO_FLAG)
    assert result.stderr.strip().endswith(f"unrecognized arguments: {NO_FLAG}"), result.stderr


def _check_make(arguments):
    """The target exists, and what it runs has the flags that ARGS passes on."""
    if shutil.which("make") is None:
        return
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("MAKE", "MFLAGS", "ARGS"))}
    options = {"capture_output": True, "text": True, "timeout": 60, "env": clean, "cwd": ROOT}
    result = subprocess.run(["make", "--dry-run", *arguments], **options)
    assert result.returncode == 0, result.stderr
    for line in result.stdout.splitlines():
        if re.search(r"python (train|eval)\.py|pip install", line):
            check(markdown.split(line))


def _check_pip(arguments):
    """It installs attjax, with extras that there are, or a peer."""
    assert arguments[0] == "install"
    for word in arguments[1:]:
        if word.startswith("-"):
            continue
        requirement = Requirement(re.sub(r"^\.", "attjax", word))
        assert requirement.name in ("attjax", *PEERS), word
        assert requirement.extras <= set(PROJECT["optional-dependencies"]), word


def _check_pytest(arguments):
    for word in arguments:
        assert word.startswith("-") or (ROOT / word.split("::")[0]).exists(), word


def _check_installed(arguments):
    """The command that the package brings: its first argument is a program."""
    programs = {"train": train_script, "eval": eval_script, "export": export_script}
    if arguments:
        _check_arguments(programs[arguments[0]], arguments[1:])


CHECKS = {
    "train.py": functools.partial(_check_arguments, train_script),
    "eval.py": functools.partial(_check_arguments, eval_script),
    "export.py": functools.partial(_check_arguments, export_script),
    "script": _check_script,
    "make": _check_make,
    "pip": _check_pip,
    "-m pip": _check_pip,
    "-m attjax": _check_installed,
    "-m pytest": _check_pytest,
    "-m venv": lambda arguments: None,
    "tensorboard": lambda arguments: None,
}


def _train(arguments):
    given = train_script.parse_arguments(arguments)
    arguments = [*arguments, *SHORT]
    if hasattr(given, "total_steps"):  # a longer run stays longer
        updates = -(-given.total_steps // 10**6)
        arguments += ["--total-steps", str(updates * STEPS_PER_UPDATE)]
    elif not (given.resume and run_folder.holds_run(given.checkpoint)):
        arguments += ["--total-steps", "1"]
    _succeeds(train_script.main, arguments)


def _evaluate(arguments):
    if "--robustness" not in arguments:  # which takes minutes: test_robustness.py runs it shortened
        _succeeds(eval_script.main, [*arguments, "--device", "cpu", "--episodes", "20"])


def _export(arguments):
    try:
        export_script._module(export_script.parse_arguments(arguments).format)
    except export_script.errors.UserError:  # the extra is not installed
        return
    _succeeds(export_script.main, [*arguments, "--device", "cpu"])


def _succeeds(main, arguments):
    assert main(arguments) == 0, arguments


def _compile(compiler, arguments):
    if shutil.which(compiler):
        _process([compiler, *arguments])


def _own_program(words):
    """A program that a command before has built, if there is a compiler."""
    if shutil.which("cc"):
        _process(words)


def _process(words):
    result = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, (words, result.stdout, result.stderr)


RUNS = {
    "train.py": _train,
    "eval.py": _evaluate,
    "export.py": _export,
    "cc": functools.partial(_compile, "cc"),
    "c++": functools.partial(_compile, "c++"),
    "own program": _own_program,
    "-c": lambda arguments: _process([sys.executable, "-c", *arguments]),
    "cd": lambda arguments: os.chdir(*arguments),
    ".": lambda arguments: None,  # the tests run in an environment of their own
    "ls": lambda arguments: _process(["ls", *arguments]),
}


def prepare(folder: Path) -> None:
    """Make the folder like a clone, as far as commands read from it."""
    shutil.copytree(ROOT / "pretrained", folder / "pretrained")
    shutil.copytree(ROOT / "docs" / "examples", folder / "docs" / "examples")
