"""Who knows of whom: settings of no JAX, learning of no spacecraft, the core of no peers."""

import importlib
import re
import tomllib

import pytest
from commands import ROOT
from sources import ALIASES, MODULES, SOURCES, imports, module_name, modules_after, packages, room

from attjax import errors

WITHOUT_JAX = (
    "values", "streams", "errors", "destinations", "resources", "spacecraft", "world",
    "config",
)  # fmt: skip
JAX = {"jax", "jaxlib", "jaxtyping", "flax", "optax", "chex", "orbax"}
OF_SPACECRAFT = {"spacecraft", "simulator", "initial_state", "reward", "attitude"}
PEERS = {"gymnasium", "gymnax", "rejax", "stable_baselines3", "torch"}
FOR_PEERS = ("wrappers", *ALIASES)


@pytest.mark.parametrize("own", WITHOUT_JAX)
def test_what_users_describe_needs_no_jax(own):
    modules = sorted(module for module in MODULES if room(module) == own)
    loaded = modules_after("".join(f"import {module}\n" for module in modules))
    assert modules and set(modules) <= loaded
    assert not loaded & JAX


@pytest.mark.parametrize("own", WITHOUT_JAX)
def test_and_asks_for_none_later(own):
    """--help, and errors in arguments: no JAX, not even within functions."""
    for path in SOURCES:
        if room(module_name(path)) == own:
            assert not JAX & packages(path), path.name
            assert {room(x) for x in imports(path)} <= {*WITHOUT_JAX, "__init__"}, path.name


def test_a_library_user_gets_no_command_line():
    """JAX may bring argparse and rich; the files of attjax that training loads ask for neither."""
    loaded = modules_after("import attjax.ppo") & MODULES
    assert "attjax.ppo.train" in loaded
    for path in SOURCES:
        if module_name(path) in loaded:
            assert not {"argparse", "rich"} & packages(path), path.name
            assert room(module_name(path)) not in ("runs", "commands"), path.name


def test_learning_never_hears_of_spacecraft_and_physics_never_of_learning():
    seen = {"ppo": 0, "dynamics": 0, "envs": 0}
    for path in SOURCES:
        own = room(module_name(path))
        known = set(imports(path))
        if own == "ppo":
            assert not OF_SPACECRAFT & {x.rpartition(".")[2] for x in known}, path.name
        if own in ("dynamics", "envs"):
            assert not {"ppo", "control", "runs"} & {room(x) for x in known}, path.name
        seen |= {own: seen.get(own, 0) + 1}
    assert min(seen[own] for own in ("ppo", "dynamics", "envs")) > 5


def test_errors_are_the_ground_floor():
    """What any module may raise, and how programs tell it, hangs on no module above."""
    (path,) = (x for x in SOURCES if module_name(x) == "attjax.errors")
    assert set(imports(path)) == {"attjax.streams"}
    for module, kind in (
        ("config.user_functions", "FunctionError"),
        ("runs.folder", "FolderError"),
    ):
        found = getattr(importlib.import_module(f"attjax.{module}"), kind)
        assert issubclass(found, errors.UserError)


def test_the_core_knows_no_peers():
    for path in SOURCES:
        if room(module_name(path)) not in FOR_PEERS:
            assert not PEERS & packages(path), path.name
            assert not set(FOR_PEERS) & {room(x) for x in imports(path)}, path.name
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    names = {re.split(r"[^\w-]", text)[0].replace("-", "_") for text in project["dependencies"]}
    assert "jax" in names and not PEERS & names
