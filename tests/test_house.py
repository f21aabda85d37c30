"""The house: sizes, signatures, and what each folder may import, as docs/layout.md says."""

import ast
import re

import pytest
from commands import ROOT
from sources import (
    ALIASES,
    FOLDERS,
    GROUND,
    MODULES,
    ORDER,
    PACKAGE,
    SOURCES,
    arguments,
    functions,
    imports,
    module_name,
    name,
    parsed,
    room,
)

SCALES = {"lines of a file": 250, "lines of a function": 45, "arguments": 7}
BESIDE = ("tests", "benchmarks", "docs")
PYTHON = sorted(
    {*SOURCES, *ROOT.glob("*.py"), *(x for y in BESIDE for x in ROOT.glob(f"{y}/**/*.py"))}
)


def test_no_file_is_long():
    lines = {name(path): len(path.read_text().splitlines()) for path in PYTHON}
    assert not {path: n for path, n in lines.items() if n > SCALES["lines of a file"]}


def test_no_function_is_long():
    long = {}
    for path in PYTHON:
        for qualified, node, _ in functions(parsed(path)):
            lines = node.end_lineno - node.lineno + 1
            if lines > SCALES["lines of a function"]:
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


def test_every_file_has_its_room():
    assert {room(module) for module in MODULES} <= set(ORDER)
    assert all((PACKAGE / x).is_dir() for x in FOLDERS)
    assert all((PACKAGE / f"{x}.py").is_file() for x in (*GROUND, *ALIASES))


@pytest.mark.parametrize("path", SOURCES, ids=name)
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


def test_the_page_tells_the_same_order():
    text = (ROOT / "docs" / "layout.md").read_text()
    cells = re.findall(r"^\| (`.+?`) \| .+ \| (?:yes|no) \|$", text, re.MULTILINE)
    rooms = [x.rstrip("/") for cell in cells for x in re.findall(r"`(\w+/?)`", cell)]
    assert tuple(rooms) == (*GROUND, *FOLDERS)
    for path in re.findall(r"`((?:\w+/)+\w+)`(?!, planned)", text):
        assert f"attjax.{path}".replace("/", ".") in MODULES, path
