"""The benchmarks' tables, each at its widest: every figure whole, within the terminal's width."""

import importlib
import json
import subprocess
import sys

import pytest
from commands import ROOT

LONG = {"low": 987_654.0, "median": 987_654.0, "high": 987_654.0, "repeats": [1.0] * 5}
ROW = {"name": "attjax, Gymnasium make_vec", "full": True, "num_envs": 1_048_576, "fraction": 0.123}
SIMULATOR = {
    "rows": [{**ROW, "compile_s": 123.4, **LONG}],
    "absent": {"Basilisk in an RL loop": "not installed (pip install bsk)"},
    "cores": 2,
    "ceilings": {"C ceiling, full step": 25e6, "C ceiling, physics only": 29e6},
}
UPDATE = {"passes": 10, "minibatch_size": 16384, "compile_s": 123.4, "steps_per_s": LONG}
TIMES = {"cpu_s": [1.98], "update_s": [1.0]}
TRAINING = [
    {"name": name, **UPDATE, **TIMES} for name in ("attjax", "Stable-Baselines3", "ceiling")
] + [{"name": "PureJaxRL", "failure": "not installed"}]
SPEED = {"cores": 1, "start_s": 12.3, "compile_s": 123.4, "peak_bytes": 2**34, **LONG}
SIMULATED = [{"num_envs": 1_048_576, **SPEED}, {"num_envs": 1_048_576, **SPEED, "cores": 2}]
TRAINED = [{"hidden_sizes": [400, 300], "minibatch_size": 16384, **row} for row in SIMULATED]
PROGRAM = {
    "unit": "agent step of an evaluation",
    "compile_s": 123.4,
    "kernels": 1234,
    "launches": 39540.0,
    "memory_bytes": 2**40,
    "free_us": 19360.0,
    "bound_us": 158300.0,
}
CALLS = {
    "simulator": ("print_result(data)", SIMULATOR, ("1,048,576", "988k–988k", "12.3 %", "20.7M")),
    "training_table": ("print_table(data, 2)", TRAINING, ("16384", "988k–988k", "1.98", "1.00")),
    "scaling": ("print_simulator(data, 2)", SIMULATED, ("1,048,576", "988k–988k", "16,384")),
    "scaling, trainings": ("print_training(data, 2)", TRAINED, ("400-300", "16384", "16,384")),
    "gpu_program": (
        "common.print_table(it.COLUMNS, [it.row(data)])",
        PROGRAM,
        ("3.954e+04", "1.936e+04", "1.583e+05", "1048576.0"),
    ),
    "time_to_quality": (
        "print_table({'paper-fast, multiscale 64-64': [it.Point(*data)]})",
        [123.4, 40_108_032, 3200.0, 0.000078, 0.00023, True, True],
        ("123", "40,108,032", "7.8e-05"),
    ),
}
SCRIPT = """
import importlib, json, sys
import common
it, data = importlib.import_module(sys.argv[1]), json.loads(sys.argv[3])
exec(sys.argv[2] if sys.argv[2].startswith("common") else "it." + sys.argv[2])
"""


@pytest.mark.parametrize("columns", ["80", "120", None])
@pytest.mark.parametrize("name", CALLS)
def test_every_figure_is_whole(name, columns):
    """None is a pipe, whose width nothing says."""
    call, data, figures = CALLS[name]
    arguments = [name.split(",")[0], call, json.dumps(data)]
    environment = {"PYTHONPATH": f"{ROOT / 'benchmarks'}:{ROOT}", "PATH": "/usr/bin:/bin"}
    environment |= {} if columns is None else {"COLUMNS": columns}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, *arguments], env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert max(map(len, lines)) <= int(columns or 80)
    assert "…" not in done.stdout
    words = done.stdout.replace("│", " ")
    assert all(figure in words for figure in figures), done.stdout


def test_a_table_wider_than_the_terminal_is_seen(monkeypatch, capsys):
    """What the test above looks for is what rich prints where figures do not fit."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    monkeypatch.setenv("COLUMNS", "80")
    common = importlib.import_module("common")
    common.print_table(["", *["x" * 30] * 4], [["name", *["1" * 30] * 4]])
    assert "…" in capsys.readouterr().out
