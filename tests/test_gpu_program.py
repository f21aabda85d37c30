"""benchmarks/gpu_program.py: kernels of programs that are compiled for a GPU that is not there."""

import importlib
import importlib.util
import json
import math

import jax
import pytest
from commands import ROOT
from doc_commands import python_process

from attjax import sharding

PROGRAM = ROOT / "tests" / "data" / "by_hand.hlo"


@pytest.fixture
def benchmark(monkeypatch):
    """A module of benchmarks/, by its name."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return importlib.import_module


def test_kernels_of_a_program_written_by_hand(benchmark):
    gpu_kernels = benchmark("gpu_kernels")
    found = {x.name: x for x in gpu_kernels.kernels(PROGRAM.read_text())}
    assert {name: x.times for name, x in found.items()} == {
        "first": 1,
        "second": 1,  # the longer branch
        "moved": 10,
        "halved": 50,
        "reduced": 1,
        "summed": 1,
        "once": 1,
        "less": 1,  # nobody knows how often: one round, and its condition
        "z": 1,
    }
    row = 128 * 4
    assert found["halved"].bytes == 2 * row and found["halved"].operations == 128
    # A row taken of the 64, the index and a row, and one put there and another given back.
    assert found["moved"].bytes == row + 4 + row + row + row
    assert found["moved"].operations == 128
    assert found["reduced"].operations == 5 * 128 and found["summed"].operations == 64 * 128
    # The workspace, 4 MiB, is not moved.
    assert found["z"].bytes == 4 * (64 * 128 + 128 * 32 + 64 * 32)
    assert found["z"].operations == 2 * 64 * 128 * 32


def test_the_bound_is_the_longest_of_three(benchmark):
    program, kernels = benchmark("gpu_program"), benchmark("gpu_kernels")
    card = benchmark("gpu_cards").CARDS["rtx-2070-super"]
    assert card.flops == pytest.approx(9.06e12, rel=1e-3)
    for moved, operations, expected in (
        (448, 9, 4.0),
        (448_000_000, 9, 1000.0),
        (448, 9_062_400_000, 1000.0),
    ):
        kernel = kernels.Kernel("k", 3, moved, operations)
        assert program.bound_us(kernel, card, 4.0) == pytest.approx(3 * expected)


def test_each_card_is_described_whole(benchmark):
    for name, card in benchmark("gpu_cards").CARDS.items():
        assert card.target.count("{") == card.target.count("}"), name
        assert f"core_count: {card.cores}\n" in card.target
        assert math.isclose(
            card.flops,
            {"rtx-2070-super": 9.06e12, "rtx-4090": 82.6e12, "a100": 19.5e12, "h100": 66.9e12}[
                name
            ],
            rel_tol=2e-3,
        )


def test_programs_are_compiled_for_other_devices_only_meanwhile():
    there = jax.devices()
    with pytest.raises(RuntimeError, match="in between"), sharding.compiled_for(there[:1] * 3):
        assert sharding.devices() == there[:1] * 3
        raise RuntimeError("in between")
    assert sharding.devices() == there


@pytest.mark.parametrize(
    "flags, message",
    [
        (["--target=voodoo"], "argument --target: invalid choice: 'voodoo'"),
        (["--preset=best"], "argument --preset: invalid choice: 'best'"),
        (["--launch-us=-1"], "launch-us is -1.0; it must be a number at least 0"),
        (["--slews=0"], "slews is 0; it must be an integer at least 1"),
        (["--longest=-1"], "longest is -1; it must be an integer at least 0"),
    ],
)
def test_bad_flags_are_one_line(flags, message):
    result = python_process("benchmarks/gpu_program.py", *flags)
    assert result.returncode == 2 and result.stderr.count("\n") == 1
    assert result.stderr.startswith("gpu_program.py: error: ") and message in result.stderr


def compiles_for_cuda():
    """Whether the extra gpu-compile is installed."""
    try:
        return importlib.util.find_spec("jax_plugins.xla_cuda12") is not None
    except ModuleNotFoundError:
        return False


@pytest.mark.skipif(compiles_for_cuda(), reason="only where nothing compiles for CUDA")
def test_without_a_compiler_it_says_what_to_install():
    result = python_process("benchmarks/gpu_program.py")
    assert result.returncode == 2 and result.stdout == ""
    expected = "gpu_program.py: error: no compiler for CUDA; pip install 'attjax[gpu-compile]'\n"
    assert result.stderr == expected


@pytest.mark.skipif(not compiles_for_cuda(), reason="needs pip install 'attjax[gpu-compile]'")
def test_it_compiles_for_an_rtx_2070_super(tmp_path):
    out = tmp_path / "figures.json"
    result = python_process("benchmarks/gpu_program.py", f"--json={out}", timeout=400)
    assert result.returncode == 0, result.stderr
    assert "Computed, not run: 4 us a launch, 448 GB/s, 9.1 Tflop/s." in result.stdout
    figures = {x["unit"]: x for x in json.loads(out.read_text())["programs"]}
    update, step = figures["update"], figures["agent step of the simulator"]
    assert step["registers_and_spills"][0] > 20 and step["registers_and_spills"][1] == 0
    assert 0 < update["free_us"] < update["bound_us"] and update["memory_bytes"] < 2**30
    for x in figures.values():
        assert x["bound_us"] >= 4 * x["launches"]
