"""The house: sizes, signatures, and what each folder may import.

The lists say the folders and files of ``attjax/`` from the ground up; each imports only those
above it. Docs/layout.md says the same in words.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "attjax"
GROUND = (  # single files, each importing only earlier ones
    "values", "streams", "errors", "destinations", "resources", "canvas", "spacecraft", "checks",
    "jax_setup", "devices", "sharding",
)  # fmt: skip
FOLDERS = (
    "config", "dynamics", "envs", "control", "wrappers", "ppo", "evaluation", "runs", "export",
    "commands",
)  # fmt: skip
ALIASES = ("gymnasium_env", "gymnasium_vector", "gymnax_compat", "sb3")
ORDER = (*GROUND, *FOLDERS, *ALIASES, "__main__", "__init__")
WITHOUT_JAX = (
    "values", "streams", "errors", "destinations", "resources", "spacecraft", "config",
)  # fmt: skip
JAX = ("jax", "jaxlib", "flax", "optax", "chex", "orbax")
SCALES = {  # lines of a file, lines of a function, arguments of a public signature
    "file": 250,
    "function": 45,
    "arguments": 7,
}
SOURCES = sorted(PACKAGE.rglob("*.py"))
BESIDE = ("tests", "benchmarks", "docs")
PYTHON = sorted(
    {*SOURCES, *ROOT.glob("*.py"), *(x for y in BESIDE for x in ROOT.glob(f"{y}/**/*.py"))}
)


def name(path):
    return str(path.relative_to(ROOT))


def each(paths):
    return pytest.mark.parametrize("path", paths, ids=name)


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


def test_no_file_is_long():
    long = {name(p): n for p in PYTHON if (n := len(p.read_text().splitlines())) > SCALES["file"]}
    assert not long


def test_no_function_is_long():
    long = {}
    for path in PYTHON:
        for qualified, node, _ in functions(parsed(path)):
            lines = node.end_lineno - node.lineno + 1
            if lines > SCALES["function"]:
                long[f"{name(path)}:{qualified}"] = lines
    assert not long


def test_no_public_signature_is_long():
    long = {}
    for path in SOURCES:
        for qualified, node, is_public in functions(parsed(path)):
            count = len(arguments(node, "." in qualified))
            if is_public and count > SCALES["arguments"]:
                long[f"{name(path)}:{qualified}"] = count
    assert not long


def test_public_signatures_are_annotated():
    bare = []
    for path in SOURCES:
        for qualified, node, is_public in functions(parsed(path)):
            if is_public:
                missing = [x.arg for x in arguments(node, "." in qualified) if x.annotation is None]
                missing += ["return"] if node.returns is None else []
                bare += [f"{name(path)}:{qualified}: {', '.join(missing)}"] if missing else []
    assert not bare, "\n".join(bare)


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


def test_every_file_has_its_room():
    assert {room(module) for module in MODULES} <= set(ORDER)
    assert all((PACKAGE / x).is_dir() for x in FOLDERS)
    assert all((PACKAGE / f"{x}.py").is_file() for x in (*GROUND, *ALIASES))


@each(SOURCES)
def test_a_folder_imports_only_those_above_it(path):
    own = room(module_name(path))
    for module in imports(path):
        other = room(module)
        if own == "__init__" or (other == "__init__" and module == "attjax"):
            continue  # the package's own file is lazy, and others take __version__ alone of it
        is_inside = own == other and own in FOLDERS
        assert is_inside or ORDER.index(other) < ORDER.index(own), f"{name(path)} imports {module}"


def test_only_the_version_is_taken_of_the_package():
    for path in SOURCES:
        if path == PACKAGE / "__init__.py":
            continue
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.ImportFrom) and node.module == "attjax" and not node.level:
                for alias in node.names:
                    is_module = f"attjax.{alias.name}" in MODULES
                    assert is_module or alias.name == "__version__", (name(path), alias.name)


def test_no_circle_within_a_folder():
    graph = {module_name(path): set(imports(path)) & MODULES for path in SOURCES}
    graph["attjax"] = set()  # lazy
    done, current = set(), []

    def visit(module):
        if module in done:
            return
        assert module not in current, " -> ".join([*current[current.index(module) :], module])
        current.append(module)
        for other in sorted(graph[module] - {module}):
            visit(other)
        done.add(current.pop())

    for module in sorted(graph):
        visit(module)


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


@pytest.mark.parametrize("own", WITHOUT_JAX)
def test_what_users_describe_needs_no_jax(own):
    modules = sorted(module for module in MODULES if room(module) == own)
    loaded = modules_after("".join(f"import {module}\n" for module in modules))
    assert modules and set(modules) <= loaded
    assert not loaded & set(JAX)


def test_a_library_user_gets_no_command_line():
    """JAX may bring argparse and rich; the files of attjax that training loads ask for neither."""
    loaded = modules_after("import attjax.ppo") & MODULES
    assert "attjax.ppo.train" in loaded
    for path in SOURCES:
        if module_name(path) in loaded:
            assert not {"argparse", "rich"} & packages(path), name(path)
            assert room(module_name(path)) not in ("runs", "commands"), name(path)


def packages(path):
    """The packages that a file imports anywhere."""
    found = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            found.add(node.module.split(".")[0])
    return found
