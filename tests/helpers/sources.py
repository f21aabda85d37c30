"""The source files of attjax as their rules see them: rooms, imports, functions."""

import ast
import subprocess
import sys

from commands import ROOT

PACKAGE = ROOT / "attjax"
GROUND = (  # single files, each importing only earlier ones
    "values", "streams", "errors", "destinations", "resources", "spacecraft",
    "canvas", "checks", "jax_setup", "devices", "sharding",
)  # fmt: skip
FOLDERS = (
    "world", "config", "dynamics", "envs", "control", "wrappers", "ppo", "evaluation", "runs",
    "export", "commands",
)  # fmt: skip
ALIASES = ("gymnasium_env", "gymnasium_vector", "gymnax_compat", "sb3")
ORDER = (*GROUND, *FOLDERS, *ALIASES, "__main__", "__init__")
SOURCES = sorted(PACKAGE.rglob("*.py"))


def name(path):
    return str(path.relative_to(ROOT))


def parsed(path):
    return ast.parse(path.read_text())


def functions(node, public=True, owner=""):
    """(qualified name, node, whether it is public) of all functions, those in functions too.

    Public is what neither itself nor what it stands in has a name that begins with an underscore,
    or stands in a function.
    """
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            is_public = public and not child.name.startswith("_")
            yield f"{owner}{child.name}", child, is_public
            yield from functions(child, False, f"{owner}{child.name}.")
        elif isinstance(child, ast.ClassDef):
            is_public = public and not child.name.startswith("_")
            yield from functions(child, is_public, f"{owner}{child.name}.")
        else:
            yield from functions(child, public, owner)


def arguments(function, is_method):
    """Its arguments, without the first of a method."""
    given = function.args
    every = [*given.posonlyargs, *given.args]
    decorators = {getattr(x, "id", "") for x in function.decorator_list}
    if is_method and "staticmethod" not in decorators:
        every = every[1:]
    return [*every, *given.kwonlyargs, *filter(None, (given.vararg, given.kwarg))]


def module_name(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(path) for path in SOURCES}


def imports(path):
    """The modules of attjax that a file imports, at its top or within functions, by full name.

    ``from attjax import x`` counts as the module x where there is one, else as the package, whose
    lazy names lead anywhere: no file of attjax may use those.
    """
    package = module_name(path)
    if path.name != "__init__.py":
        package = package.rpartition(".")[0]
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            yield from (x.name for x in node.names if x.name.split(".")[0] == "attjax")
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *filter(None, [base])])
            if base.split(".")[0] == "attjax":
                for alias in node.names:
                    full = f"{base}.{alias.name}"
                    yield full if full in MODULES else base


def room(module):
    """The folder or the file directly in attjax/ that a module stands in."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else "__init__"


def packages(path):
    """The packages that a file imports anywhere."""
    found = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add(node.module.split(".")[0])
    return found


def modules_after(code):
    """The modules that a fresh Python has loaded after some code."""
    code = f"{code}\nimport sys\nprint(*sys.modules)"
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, timeout=120, env=environment, cwd=ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())
