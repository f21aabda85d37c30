"""What a user's shell, home and folders bring along: it changes nothing, or is named in a line."""

import codecs
import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest
from commands import (
    ROOT, STEPS_PER_UPDATE, TINY, eval_script, export_script, one_line_error, run, train_script,
)  # fmt: skip

from attjax import checkpoint, cli, config_file, jax_setup, presets, run_folder

SCRIPTS = {"train.py": train_script, "eval.py": eval_script, "export.py": export_script}
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


def python(code, *arguments, **options):
    """A process that finds attjax and the programs."""
    code = f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{code}"
    command = [sys.executable, "-c", code, *map(str, arguments)]
    options = {"capture_output": True, "text": True, "timeout": 300} | options
    return subprocess.run(command, **options)


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
from attjax import cli
cli.select_device("cpu")
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


@pytest.mark.parametrize(
    "script, flag",
    [
        ("train.py", "--checkpoint"), ("train.py", "--config"), ("train.py", "--spacecraft"),
        ("eval.py", "--checkpoint"), ("eval.py", "--spacecraft"), ("eval.py", "--json"),
        ("eval.py", "--plot"), ("eval.py", "--playback"),
        ("export.py", "--checkpoint"), ("export.py", "--out"),
    ],
)  # fmt: skip
def test_paths_that_no_file_can_have_are_one_line(trained, tmp_path, capsys, script, flag):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "file").write_text("no TOML")
    needed = {} if script == "train.py" else {"--checkpoint": str(trained[0])}
    if script == "export.py":
        needed |= {"--format": "c", "--out": str(tmp_path / "flight")}
    for path, named in (
        ("", "the path is ''"),
        ("a\0b", "no NUL"),
        ("~nobody-of-this-name/x", "there is no home for '~nobody-of-this-name/x'"),
        (tmp_path / ("x" * 5000), ""),
        (tmp_path / "loop" / "x", str(tmp_path)),
        (tmp_path / "file" / "x", str(tmp_path)),
    ):
        words = [word for pair in (needed | {flag: str(path)}).items() for word in pair]
        error = one_line_error(SCRIPTS[script].main, ["--device", "cpu", *words], capsys)
        assert named in error
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "loop"]


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize("what", ["is_dir", "is_file", "iterdir", "mkdir"])
def test_folders_that_may_not_be_entered_are_one_line(
    trained, tmp_path, capsys, monkeypatch, script, what
):
    """As for anybody but root, for whom there are none: each way to look into one fails."""
    call = getattr(Path, what)

    def locked(path, *arguments, **options):
        if path.is_relative_to(trained[0]):
            raise PermissionError(13, "Permission denied", str(path))
        return call(path, *arguments, **options)

    monkeypatch.setattr(Path, what, locked)
    if what == "iterdir":  # Orbax lists a folder by other means
        monkeypatch.setattr(checkpoint.ocp.utils, "checkpoint_steps", lambda path: locked(path))
    more = {"train.py": ["--resume"], "eval.py": ["--episodes", "1", "--duration", "0.1"]}
    more["export.py"] = ["--format", "c", "--out", str(trained[0] / "flight")]
    flags = ["--device", "cpu", "--checkpoint", str(trained[0]), *more[script]]
    if (script, what) in {("eval.py", "mkdir"), ("export.py", "iterdir"), ("eval.py", "iterdir")}:
        with contextlib.suppress(SystemExit):  # they may not need it
            SCRIPTS[script].main(flags)
        error = capsys.readouterr().err
        assert "Traceback" not in error and error.count("\n") <= 1
    else:
        error = one_line_error(SCRIPTS[script].main, flags, capsys)
        assert str(trained[0]) in error


def test_a_new_folder_may_hold_hidden_files_and_the_log_of_its_own_run(tmp_path):
    for name in (".gitkeep", ".DS_Store"):
        (tmp_path / name).touch()
    (tmp_path / "lost+found").mkdir()
    code = f"""
from pathlib import Path
from attjax import presets, run_folder
config = run_folder.Config("paper", 0, presets.PAPER)
run_folder.create(Path({str(tmp_path)!r}), config, overwrite=False)
"""
    with (tmp_path / "log").open("w") as log:
        assert python(code, capture_output=False, stdout=log, stderr=log).returncode == 0
    (tmp_path / run_folder.CONFIG).unlink()
    config = run_folder.Config("paper", 0, presets.PAPER)
    with pytest.raises(run_folder.FolderError, match="holds no attjax run, but log; choose"):
        run_folder.create(tmp_path, config, overwrite=False)
    (tmp_path / "log").unlink()
    (tmp_path / ".git").mkdir()
    with pytest.raises(run_folder.FolderError, match=r"but \.git; choose"):
        run_folder.create(tmp_path, config, overwrite=False)


@pytest.mark.parametrize(
    "mark, encoding",
    [
        (codecs.BOM_UTF8, "utf-8"),
        (codecs.BOM_UTF16_LE, "utf-16-le"),
        (codecs.BOM_UTF16_BE, "utf-16-be"),
    ],
)
def test_toml_with_a_byte_order_mark_is_read(tmp_path, mark, encoding):
    path = tmp_path / "run.toml"
    path.write_bytes(mark + 'preset = "paper"\r\nseed = 5 # Größe\r\n'.encode(encoding))
    assert config_file.read(path) == {"preset": "paper", "seed": 5}
    craft = 'name = "Größe"\ninertia = [1, 1, 1]\ntorque_levels = [0.1]\n'
    path.write_bytes(mark + craft.encode(encoding))
    assert config_file.read_spacecraft(path).name == "Größe"


def test_toml_of_endless_depth_is_one_line(tmp_path, capsys):
    path = tmp_path / "run.toml"
    path.write_text("seed = " + "[" * 100_000)
    for flag in ("--config", "--spacecraft"):
        assert "is no TOML" in one_line_error(train_script.main, [flag, str(path)], capsys)


def test_a_tilde_is_the_home_where_the_shell_leaves_it(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cli.path("~/runs/a") == tmp_path / "runs" / "a"
    arguments = train_script.parse_arguments(["--checkpoint=~/a", "--config=~/b", "--spacecraft=~"])
    assert arguments.checkpoint == tmp_path / "a" and arguments.config == tmp_path / "b"
    assert arguments.spacecraft == tmp_path


def test_json_to_stdout_leaves_the_report_to_stderr(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    flags = ["--controller=feedback", "--episodes=5", "--duration=1", "--device=cpu"]
    assert eval_script.main([*flags, "--json", "-"]) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["episodes"] == 5
    assert "feedback: 5 slews" in printed.err and not list(tmp_path.iterdir())


@pytest.mark.parametrize("backend", ["module://no_such_backend", "nonsense", "TkAgg"])
def test_plots_need_no_backend_of_the_user(tmp_path, backend):
    code = """
from pathlib import Path
import eval
plots = eval._prepare_plots(Path(sys.argv[1]))
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
