"""One-way imports, as in docs/layout.md: a module knows only those of earlier layers."""

import ast
import importlib
import re
import tomllib
from pathlib import Path

import attjax
from attjax import errors

LAYERS = [
    {"values", "streams"},
    {"errors"},
    {
        "user_functions",
        "quiet",
        "specification",
        "template",
        "checks",
        "spaces",
        "kernel",
        "numerics",
        "sb3",
        "canvas",
        "signals",
        "sharding",
    },
    {"vector", "belongings"},
    {"fields", "programs", "context", "c_names", "c_text"},
    {"settings", "quaternion", "rigid_body"},
    {"equations"},
    {"dynamics"},
    {"spacecraft", "reward", "observation"},
    {"env"},
    {"controllers", "gymnax_compat", "features", "assurance"},
    {"networks", "losses", "rendering"},
    {"slew_references"},
    {"learner", "evaluation", "gymnasium_task", "export_inputs"},
    {"gymnasium_vector"},
    {"gymnasium_env"},
    {"rollout", "descent"},
    {"ppo"},
    {"presets"},
    {"run_config"},
    {"assembly", "run_folder", "nan_search"},
    {"help_text", "metrics", "provenance", "jax_setup"},
    {"progress_status", "metrics_file", "learning_curve", "report", "flight_policy"},
    {"cli", "destinations", "panel", "devices"},
    {"checkpoint", "config_file", "tensorboard", "flight_check", "progress"},
    {"run"},
    {"keeper"},
    {"training", "plots", "playback", "export_c", "export_onnx", "export_stablehlo"},
    {"commands"},
]
LEARNING = {"networks", "losses", "learner", "rollout", "descent", "ppo"}
SPACECRAFT = {"spacecraft", "reward", "env"}
PEERS = {"gymnasium", "gymnax", "rejax", "stable_baselines3", "torch"}
FOR_PEERS = {"gymnasium_env", "gymnasium_vector", "gymnasium_task", "gymnax_compat", "sb3"}
FOLDER = Path(attjax.__file__).parent


def nodes(module):
    """Of a module, or of all in a folder of them."""
    folder = FOLDER / module
    for path in folder.glob("*.py") if folder.is_dir() else [FOLDER / f"{module}.py"]:
        yield from ast.walk(ast.parse(path.read_text()))


def imports(module):
    """The attjax modules that a module imports, at its top or inside functions."""
    found = set()
    for node in nodes(module):
        if isinstance(node, ast.ImportFrom) and node.module == "attjax":
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("attjax."):
            found.add(node.module.split(".")[1])
        elif isinstance(node, ast.Import):
            found |= {a.name.split(".")[1] for a in node.names if a.name.startswith("attjax.")}
    return found - {module}


def test_every_module_has_its_layer():
    modules = {path.stem for path in FOLDER.glob("*.py")} - {"__init__", "__main__"}
    modules |= {path.parent.name for path in FOLDER.glob("*/__init__.py")}
    assert modules == set().union(*LAYERS)


def test_modules_import_only_earlier_layers():
    earlier = set()
    for layer in LAYERS:
        for module in layer:
            assert imports(module) <= earlier, module
        earlier |= layer


def test_learning_never_hears_of_spacecraft_and_physics_never_of_learning():
    for module in LEARNING:
        assert not imports(module) & SPACECRAFT, module
    for module in SPACECRAFT | {"quaternion", "equations", "dynamics", "observation"}:
        assert not imports(module) & LEARNING, module


def test_errors_are_the_ground_floor():
    """What any module may raise, and how programs tell it, hangs on no module above."""
    assert imports("errors") == {"streams"} and not imports("streams")
    for module, kind in (("user_functions", "FunctionError"), ("run_folder", "FolderError")):
        found = getattr(importlib.import_module(f"attjax.{module}"), kind)
        assert issubclass(found, errors.UserError)


def packages(module):
    """The packages that a module imports."""
    for node in nodes(module):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").split(".")[0]


def test_what_programs_say_before_they_work_needs_no_jax():
    """--help, and errors in arguments: no JAX, not even late, nor a module that imports it."""
    reached, found = {"cli"}, set()
    while reached - found:
        found |= reached
        reached |= set().union(*map(imports, found))
    for module in found:
        assert not {"jax", "numpy", "chex", "flax"} & set(packages(module)), module


def test_the_core_knows_no_peers():
    for module in set().union(*LAYERS) - FOR_PEERS:
        assert not PEERS & set(packages(module)), module
        assert not FOR_PEERS & imports(module), module
    project = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text())["project"]
    names = {re.split(r"[^\w-]", text)[0].replace("-", "_") for text in project["dependencies"]}
    assert "jax" in names and not PEERS & names
