"""``attjax train|eval|export``: the installed command, which runs what train.py and so on run."""

import fnmatch
import importlib
import subprocess
import sys
import tomllib

import pytest
from commands import ROOT, TINY, python, run

import attjax
from attjax import commands

PROGRAMS = {"train.py", "eval.py", "export.py"}


def ran(argv, capsys):
    """Exit status, stdout and stderr of the command."""
    with pytest.raises(SystemExit) as exit_:
        commands.main(argv)
    return exit_.value.code or 0, *capsys.readouterr()


def test_it_knows_the_programs():
    assert {f"{name}.py" for name in commands.COMMANDS} == PROGRAMS
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    module, name = project["scripts"]["attjax"].split(":")
    assert getattr(importlib.import_module(module), name) is commands.main


def test_its_help_names_every_command(capsys):
    status, out, _ = ran(["--help"], capsys)
    assert status == 0
    for name, meaning in commands.COMMANDS.items():
        assert any(line.split() == [name, *meaning.split()] for line in out.splitlines())


def test_its_version(capsys):
    assert ran(["--version"], capsys) == (0, f"attjax {attjax.__version__}\n", "")


@pytest.mark.parametrize(
    "argv, named", [([], "COMMAND"), (["fly"], "'fly'"), (["tra"], "'tra'"), (["--seed", "3"], "")]
)
def test_a_wrong_command_is_one_line(argv, named, capsys):
    status, out, error = ran(argv, capsys)
    assert (status, out) == (2, "")
    assert error.startswith("attjax: error: ") and named in error and error.count("\n") == 1


@pytest.mark.parametrize("name", commands.COMMANDS)
def test_a_program_speaks_under_the_name_that_it_was_started_by(name, capsys):
    status, out, error = ran([name, "--seed", "x"], capsys)
    assert (status, out) == (2, "") and error.startswith(f"attjax {name}: error: argument --seed")
    status, out, _ = ran([name, "--help"], capsys)
    assert status == 0 and out.startswith(f"usage: attjax {name} ")
    assert f"  attjax {name} --" in out and ".py" not in out
    main = importlib.import_module(f"attjax.commands.{name}").main
    with pytest.raises(SystemExit):
        main(["--seed", "x"])
    assert capsys.readouterr().err.startswith(f"{name}.py: error: argument --seed")


def test_it_trains_as_a_module(tmp_path):
    flags = ["-m", "attjax", "train", *TINY, "--total-steps", "1", "--checkpoint", str(tmp_path)]
    done = subprocess.run([sys.executable, *flags], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith(f"trained; evaluate with: attjax eval --checkpoint {tmp_path}\n")


@pytest.mark.parametrize("argv", [["--help"], ["train", "--help"], ["eval", "--help"]])
def test_help_is_there_at_once(argv):
    heavy = ("jax", "numpy", "rich", "matplotlib", "flax", "orbax", "tensorboardX")
    done = python(f"""
from attjax import commands
try:
    commands.main({argv})
except SystemExit:
    print([name for name in {heavy} if name in sys.modules])
""")
    assert done.stdout.splitlines()[-1] == "[]", done.stderr


@pytest.mark.parametrize("program", sorted(PROGRAMS))
def test_the_files_at_the_top_run_the_same_programs(program):
    done = run(program, "--seed", "x")
    assert done.returncode == 2 and done.stderr.startswith(f"{program}: error: argument --seed")


def test_a_wheel_holds_every_file_of_the_package():
    """What setuptools packs by pyproject.toml: folders with an __init__.py, files by pattern."""
    tool = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert tool["packages"] == {"find": {"include": ["attjax*"]}}
    (patterns,) = (tool["package-data"][package] for package in tool["package-data"])
    packages = {path.parent for path in (ROOT / "attjax").rglob("__init__.py")}
    for path in (ROOT / "attjax").rglob("*"):
        if path.is_dir() or "__pycache__" in path.parts:
            continue
        package = next(folder for folder in path.parents if folder in packages)
        inside = str(path.relative_to(package))
        is_module = path.suffix == ".py" and path.parent == package
        assert is_module or any(fnmatch.fnmatch(inside, p) for p in patterns), path
