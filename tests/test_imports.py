"""Importing the library changes nothing of the process that others rely on."""

import logging
import sys
from types import SimpleNamespace

import pytest
from commands import python

from attjax.runs import quiet

FRESH = """
import ast, codecs, importlib, logging, os, pkgutil, signal, warnings
from pathlib import Path
import attjax

names = [m.name for m in pkgutil.walk_packages(attjax.__path__, "attjax.")]
names = [name for name in names if not name.endswith("__main__")]

def others(name):
    "What a module imports at its top, of others: their own side effects are not ours."
    for node in ast.parse(Path(importlib.util.find_spec(name).origin).read_text()).body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))

def tried(name):
    try:
        importlib.import_module(name)
    except ImportError as error:
        return error.name

for other in sorted({other for name in names for other in others(name)} | {"matplotlib"}):
    if not other.startswith("attjax"):
        tried(other)

import jax
import matplotlib
from jax._src import xla_bridge

def state():
    loggers = {"": logging.getLogger(), **logging.root.manager.loggerDict}
    levels = {name: getattr(logger, "level", 0) for name, logger in loggers.items()}
    return {
        "levels": {name: level for name, level in levels.items() if level},
        "disabled": logging.root.manager.disable,
        "filters": list(warnings.filters),
        "showwarning": warnings.showwarning,
        "hooks": (sys.unraisablehook, sys.excepthook, sys.displayhook, sys.stdout, sys.stderr),
        "path": list(sys.path),
        "environment": dict(os.environ),
        "folder": os.getcwd(),
        "signals": {number: signal.getsignal(number) for number in signal.valid_signals()},
        "matplotlib": dict(matplotlib.rcParams),
        "jax": dict(jax.config.values),
        "devices": xla_bridge.backends_are_initialized(),
    }

before = state()
absent = {name: tried(name) for name in names}
after = state()
for what in before:
    assert before[what] == after[what], (what, before[what], after[what])
ours = {name for name, missing in absent.items() if missing and missing.startswith("attjax")}
assert not ours and sum(missing is None for missing in absent.values()) > 40, absent
try:
    codecs.lookup_error("attjax.plain")
except LookupError:
    print("unchanged")
"""


def test_importing_every_module_changes_nothing_of_the_process():
    done = python(FRESH)
    assert done.stdout == "unchanged\n" and done.stderr == "", done.stderr


@pytest.mark.parametrize("fails", [False, True])
def test_orbax_is_kept_quiet_no_longer_than_it_works(fails, monkeypatch, caplog):
    """Where it fails its threads and tasks go on: what it says of them, no more, is dropped."""
    heard = []
    monkeypatch.setattr(sys, "unraisablehook", heard.append)
    loggers = [logging.getLogger(name) for name in quiet.LOGGERS]
    for logger in loggers:
        monkeypatch.setattr(logger, "level", logging.INFO)
        monkeypatch.setattr(logger, "filters", [])
    before = sys.unraisablehook
    for _ in range(2):
        with quiet.orbax() as failures:
            assert sys.unraisablehook is not before
            assert {logger.level for logger in loggers} == {logging.CRITICAL}
            failures += ["as Orbax may"] * fails
        assert (sys.unraisablehook is before) == (not fails)
        assert {logger.level for logger in loggers} == {logging.INFO}
    of_orbax = SimpleNamespace(exc_traceback=None, exc_value=RuntimeError("Event loop is closed"))
    other = SimpleNamespace(exc_traceback=None, exc_value=RuntimeError("other"))
    sys.unraisablehook(of_orbax)
    sys.unraisablehook(other)
    assert heard == ([other] if fails else [of_orbax, other])
    task = "Task exception was never retrieved\nfuture: <Task coro=<save() defined at %s:188>>"
    of_user = "own/orbax/save.py"
    for file in (f"{quiet.ORBAX}/_src/serialization/handlers.py", of_user):
        logging.getLogger("asyncio").error(task, file)
    assert [of_user in text for text in caplog.messages] == [False, True][fails:]
