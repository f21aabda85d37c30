"""Build the API reference from the docstrings, as HTML: ``python docs/reference.py FOLDER``.

It needs the extra ``docs``. Modules whose peers are not installed are left out.
"""

import importlib
import pkgutil
import sys
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import chex
import optax  # noqa: F401 (imports chex before its types change)
import pdoc

import attjax

PEERS = {
    "attjax.wrappers.gymnasium": ["gymnasium"],
    "attjax.gymnasium_env": ["gymnasium"],
    "attjax.gymnasium_vector": ["gymnasium"],
    "attjax.wrappers.rendering": ["matplotlib"],
    "attjax.wrappers.sb3": ["gymnasium", "stable_baselines3"],
    "attjax.sb3": ["gymnasium", "stable_baselines3"],
    "attjax.wrappers.gymnax": ["gymnax"],
    "attjax.gymnax_compat": ["gymnax"],
    "attjax.export.stablehlo": ["flatbuffers"],
    "attjax.export.onnx": ["onnx"],
    "attjax.evaluation.plots": ["matplotlib"],
    "attjax.runs.learning_curve": ["matplotlib"],
}


def list_modules(package: ModuleType) -> None:
    """Name a package's modules in its ``__all__``, where pdoc looks, if their peers are here."""
    names = []
    for module in pkgutil.iter_modules(package.__path__):
        full = f"{package.__name__}.{module.name}"
        if module.name != "__main__" and all(map(find_spec, PEERS.get(full, []))):
            names.append(module.name)
            if module.ispkg:
                list_modules(importlib.import_module(full))
    package.__all__ = list(dict.fromkeys([*getattr(package, "__all__", []), *names]))


def build(folder: Path) -> None:
    """Write the reference into a folder."""
    # Shown by name; what they stand for fills lines.
    chex.Array, chex.PRNGKey, chex.ArrayTree = (
        type(name, (), {"__module__": "chex"}) for name in ("Array", "PRNGKey", "ArrayTree")
    )
    # pdoc finds a name only once it is there.
    vars(attjax).update({name: getattr(attjax, name) for name in attjax.__all__})
    list_modules(attjax)
    pdoc.render.configure(docformat="google", footer_text=f"attjax {attjax.__version__}")
    pdoc.pdoc("attjax", output_directory=folder)


if __name__ == "__main__":
    build(Path(sys.argv[1]))
