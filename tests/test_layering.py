"""One-way imports, as in docs/layout.md: a module knows only those of earlier layers."""

import ast
import re
import tomllib
from pathlib import Path

import attjax

LAYERS = [
    {"values"},
    {
        "user_functions",
        "specification",
        "template",
        "checks",
        "spaces",
        "kernel",
        "numerics",
        "sb3",
        "canvas",
        "signals",
    },
    {"vector", "belongings", "streams"},
    {"settings", "programs", "context", "c_names", "c_text"},
    {"quaternion", "rigid_body"},
    {"dynamics"},
    {"spacecraft", "reward", "observation"},
    {"env"},
    {"controllers", "gymnax_compat"},
    {"networks", "losses", "rendering"},
    {"learner", "evaluation", "gymnasium_task"},
    {"gymnasium_vector"},
    {"gymnasium_env"},
    {"rollout", "descent"},
    {"ppo"},
    {"presets", "assembly", "run_folder", "nan_search"},
    {"help_text", "panel", "provenance", "jax_setup"},
    {"progress", "metrics", "report", "errors", "flight_policy"},
    {"cli", "destinations"},
    {"checkpoint", "config_file", "tensorboard", "flight_check"},
    {"training", "plots", "playback", "export_c", "export_onnx", "export_stablehlo"},
]
LEARNING = {"networks", "losses", "learner", "rollout", "descent", "ppo"}
SPACECRAFT = {"spacecraft", "reward", "env"}
PEERS = {"gymnasium", "gymnax", "rejax", "stable_baselines3", "torch"}
FOR_PEERS = {"gymnasium_env", "gymnasium_vector", "gymnasium_task", "gymnax_compat", "sb3"}
FOLDER = Path(attjax.__file__).parent


def imports(module):
    """The attjax modules that a module imports, at its top or inside functions."""
    found = set()
    for node in ast.walk(ast.parse((FOLDER / f"{module}.py").read_text())):
        if isinstance(node, ast.ImportFrom) and node.module == "attjax":
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("attjax."):
            found.add(node.module.split(".")[1])
        elif isinstance(node, ast.Import):
            found |= {a.name.split(".")[1] for a in node.names if a.name.startswith("attjax.")}
    return found


def test_every_module_has_its_layer():
    modules = {path.stem for path in FOLDER.glob("*.py")} - {"__init__"}
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
    for module in SPACECRAFT | {"quaternion", "dynamics", "observation"}:
        assert not imports(module) & LEARNING, module


def packages(module):
    """The packages that a module imports."""
    for node in ast.walk(ast.parse((FOLDER / f"{module}.py").read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield (node.module or "").split(".")[0]


def test_the_core_knows_no_peers():
    for module in set().union(*LAYERS) - FOR_PEERS:
        assert not PEERS & set(packages(module)), module
        assert not FOR_PEERS & imports(module), module
    project = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text())["project"]
    names = {re.split(r"[^\w-]", text)[0].replace("-", "_") for text in project["dependencies"]}
    assert "jax" in names and not PEERS & names
