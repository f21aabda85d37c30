"""What the program leans on: tested versions, no pickle, no eval, no network."""

import ast
import importlib.metadata
import socket
import sys
import tomllib
from pathlib import Path

import pytest
from commands import ROOT, TINY, eval_script, train_script
from packaging.requirements import Requirement

SCRIPTS = [ROOT / name for name in ("train.py", "eval.py", "export.py")]
SOURCES = [*(ROOT / "attjax").rglob("*.py"), *SCRIPTS]
MODULES = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
MODULES |= {"socket", "urllib", "http", "requests", "ftplib"}
CORE = {"jax", "jaxlib", "flax", "optax", "chex", "jaxtyping", "numpy", "orbax-checkpoint", "rich"}
IMPORTED = {name.removesuffix("-checkpoint") for name in CORE}
FOR_EXTRAS = {
    "canvas.py", "evaluation/plots.py", "export/onnx.py", "export/stablehlo.py",
    "runs/tensorboard.py", "wrappers/gymnasium/__init__.py", "wrappers/gymnasium/single.py",
    "wrappers/gymnasium/task.py", "wrappers/gymnasium/vector.py", "wrappers/gymnax.py",
    "wrappers/rendering.py", "wrappers/sb3.py",
}  # fmt: skip
CALLS = {"eval", "exec", "compile", "__import__"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.name)
def test_sources_unpickle_and_evaluate_nothing(path: Path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            assert not {alias.name.split(".")[0] for alias in node.names} & MODULES
        elif isinstance(node, ast.ImportFrom):
            assert (node.module or "").split(".")[0] not in MODULES
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            assert node.func.id not in CALLS
        elif isinstance(node, ast.keyword):
            assert node.arg != "allow_pickle"


def test_installed_versions_are_within_the_ranges():
    required = [Requirement(text) for text in importlib.metadata.requires("attjax")]
    core = [r for r in required if r.marker is None or r.marker.evaluate({"extra": ""})]
    assert len(core) >= 9
    for requirement in core:
        assert {s.operator for s in requirement.specifier} == {">=", "<"}, requirement
        version = importlib.metadata.version(requirement.name)
        assert requirement.specifier.contains(version), (requirement, version)


def test_the_core_needs_these_packages_and_no_others():
    """What ``pip install attjax`` brings; whatever else is there is theirs, or an extra."""
    required = [Requirement(text) for text in importlib.metadata.requires("attjax")]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert {r.name for r in map(Requirement, project["dependencies"])} == CORE
    assert {r.name for r in required if r.marker is None or "extra" not in str(r.marker)} == CORE


def test_core_modules_import_the_core_alone():
    """The modules that import an extra's package are those that docs/install.md names it for."""
    for path in SOURCES:
        if not any(path == ROOT / "attjax" / x for x in FOR_EXTRAS):
            for package in third_party(ast.parse(path.read_text())):
                assert package in IMPORTED, (path.name, package)


def third_party(module):
    """The packages that a module imports, wherever, but for the standard library and itself."""
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module]
        else:
            continue
        packages = {name.split(".")[0] for name in names}
        yield from packages - set(sys.stdlib_module_names) - {"attjax"}


def test_training_and_evaluation_open_no_connection(tmp_path, monkeypatch):
    def refuse(*arguments, **_):
        raise AssertionError(f"a connection to {arguments[1:]}")

    for name in ("connect", "connect_ex", "bind"):
        monkeypatch.setattr(socket.socket, name, refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    folder = ["--checkpoint", str(tmp_path / "run")]
    assert train_script.main([*TINY, "--total-steps", "1", "--tensorboard", *folder]) == 0
    arguments = ["--episodes", "2", "--duration", "1", "--device", "cpu"]
    assert eval_script.main([*arguments, *folder]) == 0


def test_the_extra_leaves_out_gymnasiums_of_wrong_statistics():
    """Up to 1.3, RecordEpisodeStatistics counts too few steps of vectors that reset at once."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (gymnasium,) = map(Requirement, project["optional-dependencies"]["gym"])
    assert not gymnasium.specifier.contains("1.3.99") and gymnasium.specifier.contains("1.4.0")
