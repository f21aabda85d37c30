"""What a user's shell and home bring along: it changes nothing, or is named in a line."""

import os
import subprocess
from pathlib import Path

import jax
import numpy as np
import pytest
from commands import STEPS_PER_UPDATE, TINY, python, run

from attjax import jax_setup
from attjax.runs import checkpoint

HOSTILE = {
    "JAX_CHECK_TRACER_LEAKS": "1", "JAX_DEBUG_INFS": "1", "JAX_DEBUG_KEY_REUSE": "1",
    "JAX_DEBUG_NANS": "1", "JAX_DEFAULT_MATMUL_PRECISION": "bfloat16",
    "JAX_DEFAULT_PRNG_IMPL": "rbg", "JAX_DISABLE_JIT": "1", "JAX_DISABLE_MOST_OPTIMIZATIONS": "1",
    "JAX_ENABLE_CHECKS": "1", "JAX_ENABLE_CUSTOM_PRNG": "1", "JAX_ENABLE_X64": "1",
    "JAX_ERROR_CHECKING_BEHAVIOR_DIVIDE": "raise", "JAX_ERROR_CHECKING_BEHAVIOR_NAN": "raise",
    "JAX_ERROR_CHECKING_BEHAVIOR_OOB": "raise", "JAX_EXEC_TIME_OPTIMIZATION_EFFORT": "-1",
    "JAX_HIGH_DYNAMIC_RANGE_GUMBEL": "1", "JAX_LEGACY_PRNG_KEY": "error", "JAX_NO_EXECUTION": "1",
    "JAX_NO_TRACING": "1", "JAX_NUMPY_DTYPE_PROMOTION": "strict",
    "JAX_NUMPY_RANK_PROMOTION": "raise", "JAX_OPTIMIZATION_LEVEL": "O0",
    "JAX_RANDOM_SEED_OFFSET": "7", "JAX_SCAN3": "1", "JAX_THREEFRY_PARTITIONABLE": "0",
    "JAX_TRANSFER_GUARD": "disallow",
    "COLUMNS": "1", "LC_ALL": "C", "PYTHONOPTIMIZE": "2", "PYTHONWARNINGS": "error",
    "TERM": "dumb", "TZ": "Nowhere/None",
}  # fmt: skip


def test_settings_from_the_environment_change_no_bit_of_a_run(trained, tmp_path):
    pinned = {name.upper() for name in jax_setup.SETTINGS}
    assert pinned <= HOSTILE.keys() and HOSTILE.keys() - pinned >= {"JAX_LEGACY_PRNG_KEY"}
    folder = tmp_path / "run"
    flags = [*TINY, "--total-steps", 60 * STEPS_PER_UPDATE, "--checkpoint", folder]
    done = run("train.py", *flags, env=os.environ | HOSTILE, stdin=subprocess.DEVNULL)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    a, b = (checkpoint.restore_policy(path).args[0] for path in (trained[0], folder))
    jax.tree.map(np.testing.assert_array_equal, a, b)


@pytest.mark.parametrize("script", ["eval.py", "export.py"])
def test_settings_from_the_environment_stop_no_evaluation_and_no_export(trained, tmp_path, script):
    more = ["--episodes", 5, "--duration", 1]
    if script == "export.py":
        more = ["--format", "c", "--out", tmp_path / "flight"]
    flags = ["--checkpoint", trained[0], "--device", "cpu", *more]
    done = run(script, *flags, env=os.environ | HOSTILE)
    assert done.returncode == 0 and done.stderr == "", done.stderr


@pytest.mark.parametrize(
    "name, value",
    [
        ("JAX_PLATFORMS", "cuda"),
        ("JAX_PLATFORMS", "nonsense"),
        ("JAX_NUM_CPU_DEVICES", "abc"),
        ("JAX_ENABLE_X64", "maybe"),
    ],
)
def test_a_variable_with_which_jax_cannot_start_is_named(tmp_path, name, value):
    environment = os.environ | {"CUDA_VISIBLE_DEVICES": "-1", name: value}
    done = run("train.py", "--checkpoint", tmp_path / "run", env=environment)
    assert done.returncode == 2 and f"{name} is '{value}'" in done.stderr
    assert done.stderr.count("\n") == 1 and not (tmp_path / "run").exists()


def test_without_a_home_nothing_is_kept(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert jax_setup.cache_folder().is_relative_to(tmp_path / "cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert jax_setup.cache_folder() is None
    monkeypatch.setenv("XDG_CACHE_HOME", "not/absolute")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert jax_setup.cache_folder().is_relative_to(tmp_path / ".cache")
    monkeypatch.setenv("HOME", "not/absolute")
    assert jax_setup.cache_folder() is None and not Path("not").exists()


def test_a_user_without_an_entry_and_a_home_can_evaluate():
    code = """
import os, pwd
for name in ("HOME", "XDG_CACHE_HOME"):
    os.environ.pop(name, None)
def unknown(*_):
    raise KeyError("no such user")
pwd.getpwuid = pwd.getpwnam = unknown
import eval
flags = ["--controller=feedback", "--episodes=5", "--duration=1", "--device=cpu"]
assert eval.main(flags) == 0
eval.main(["--json", "~/x"])
"""
    done = python(code)
    error = "eval.py: error: argument --json: there is no home for '~/x'; write it out\n"
    assert done.returncode == 2 and done.stderr == error


COMPILE = """
from attjax import devices
devices.select_device("cpu")
import jax
jax.jit(lambda x: x + 1)(1.0)
"""


def test_a_damaged_entry_of_the_cache_is_replaced_in_silence(tmp_path):
    base = {name: x for name, x in os.environ.items() if name != "JAX_COMPILATION_CACHE_DIR"}
    base |= {"JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}  # one that the user has set
    for number in range(3):
        done = python(COMPILE, env=base | {"XDG_CACHE_HOME": str(tmp_path)})
        assert done.returncode == 0 and done.stderr == "", done.stderr
        entries = sorted((tmp_path / "attjax" / "compiled").glob("jit_*"))
        assert entries and all(path.stat().st_size > 20 for path in entries)
        for path in entries:
            content = path.read_bytes()
            path.write_bytes(content[:20] if number == 0 else content[:-9] + b"\0" * 9)
    own = tmp_path / "own"
    hostile = {"JAX_COMPILATION_CACHE_DIR": str(own), "XDG_CACHE_HOME": str(tmp_path / "no")}
    assert python(COMPILE, env=base | hostile).returncode == 0
    assert list(own.glob("jit_*")) and not (tmp_path / "no").exists()


@pytest.mark.parametrize("backend", ["module://no_such_backend", "nonsense", "TkAgg"])
def test_plots_need_no_backend_of_the_user(tmp_path, backend):
    code = """
from pathlib import Path
from attjax.commands import evaluation_output
plots = evaluation_output.prepare_plots(Path(sys.argv[1]))
from attjax import canvas
print(canvas.save(canvas.subplots(figsize=(1, 1))[0], Path(sys.argv[1]), "figure").exists())
"""
    done = python(code, tmp_path, env=os.environ | {"MPLBACKEND": backend})
    assert done.stdout == "True\n", done.stderr


def test_an_unreadable_matplotlibrc_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "matplotlibrc").write_bytes(b"figure.facecolor: \xff\xfe\n")
    code = "import eval\nsys.exit(eval.main(sys.argv[1:]))"
    flags = ["--controller=feedback", "--episodes=5", "--device=cpu", "--plot", tmp_path / "x"]
    done = python(code, *flags, cwd=tmp_path)
    assert done.returncode == 2 and "matplotlibrc" in done.stderr, done.stderr
    assert "Traceback" not in done.stderr
