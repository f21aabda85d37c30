"""What the program leans on: tested versions, no pickle, no eval, no network."""

import ast
import importlib.metadata
import socket
from pathlib import Path

import pytest
from commands import ROOT, TINY, eval_script, train_script
from packaging.requirements import Requirement

SCRIPTS = [ROOT / name for name in ("train.py", "eval.py", "export.py")]
SOURCES = [*(ROOT / "attjax").glob("*.py"), *SCRIPTS]
MODULES = {"pickle", "marshal", "shelve", "dill", "cloudpickle", "joblib"}
MODULES |= {"socket", "urllib", "http", "requests", "ftplib"}
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
    assert len(core) >= 8
    for requirement in core:
        assert {s.operator for s in requirement.specifier} == {">=", "<"}, requirement
        version = importlib.metadata.version(requirement.name)
        assert requirement.specifier.contains(version), (requirement, version)


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
