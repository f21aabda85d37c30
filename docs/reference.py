"""Build the API reference from the docstrings, as HTML: ``python docs/reference.py FOLDER``.

It needs the extra ``docs``. Modules whose peers are not installed are left out.
"""

import importlib.util
import sys
from pathlib import Path

import chex
import optax  # noqa: F401 (imports chex before its types change)
import pdoc

import attjax

PEERS = {
    "gymnasium_env": ["gymnasium"],
    "gymnasium_vector": ["gymnasium"],
    "gymnasium_task": ["gymnasium"],
    "rendering": ["matplotlib"],
    "sb3": ["gymnasium", "stable_baselines3"],
    "gymnax_compat": ["gymnax"],
    "export_stablehlo": ["flatbuffers"],
    "export_onnx": ["onnx"],
    "plots": ["matplotlib"],
    "learning_curve": ["matplotlib"],
}


def modules() -> list[str]:
    """The modules that can be imported here."""
    names = sorted(path.stem for path in Path(attjax.__file__).parent.glob("[!_]*.py"))
    return [name for name in names if all(map(importlib.util.find_spec, PEERS.get(name, [])))]


def build(folder: Path) -> None:
    """Write the reference into a folder."""
    # Shown by name; what they stand for fills lines.
    chex.Array, chex.PRNGKey, chex.ArrayTree = (
        type(name, (), {"__module__": "chex"}) for name in ("Array", "PRNGKey", "ArrayTree")
    )
    # pdoc lists what __all__ names, and finds it only once it is there.
    vars(attjax).update({name: getattr(attjax, name) for name in attjax.__all__})
    attjax.__all__ = attjax.__all__ + modules()
    pdoc.render.configure(docformat="google", footer_text=f"attjax {attjax.__version__}")
    pdoc.pdoc("attjax", output_directory=folder)


if __name__ == "__main__":
    build(Path(sys.argv[1]))
