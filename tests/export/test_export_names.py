"""C exports under any prefix and name: compiled as C and C++, linked into one program."""

import subprocess

import exported
import numpy as np
import pytest
from commands import ROOT, export_script, one_line_error

from attjax.export import c as export_c
from attjax.export import flight_check
from attjax.spacecraft import Spacecraft

PRECISE = ROOT / "pretrained" / "precise"
RATES = {"fast": 5, "slow_11hz": 20}
LANGUAGES = [
    pytest.param(
        language,
        marks=pytest.mark.skipif(exported.compiler(language) is None, reason="no compiler"),
    )
    for language in ("c", "c++")
]
BOTH = """
#include "fast_policy.h"
#include "slow_11hz_policy.h"

#include <stdio.h>

int main(void)
{
    float x[7];
    while (fread(x, sizeof(float), 7, stdin) == 7) {
        printf("%d %d\\n", fast_decide(x, x + 4), slow_11hz_decide(x, x + 4));
    }
    return fast_torque_table[1][0] > 0.0f && slow_11hz_torque_table[FAST_NO_TORQUE][0] > 0.0f &&
           FAST_CONTROL_PERIOD < SLOW_11HZ_CONTROL_PERIOD;
}
"""


def arguments(out, *flags):
    given = ["--checkpoint", PRECISE, "--format", "c", "--out", out, "--device", "cpu", *flags]
    return [str(x) for x in given]


def decisions(folder, *compilations):
    """What both policies decide in one program, at states of the first one's slews."""
    flights = [exported.load(PRECISE, frameskip) for frameskip in RATES.values()]
    flown = flight_check.flown_decisions(flights[0], 3, 40, 50)
    for language, names in compilations:
        exported.compile_c(folder, "-O2", "-c", *names, language=language)
    objects = [path.name for path in folder.glob("*.o")]
    linker = exported.compiler(compilations[0][0])
    subprocess.run([linker, *objects, "-o", "both", "-lm"], cwd=folder, check=True)
    states = np.concatenate([flown.quaternion, flown.angular_velocity], axis=1)
    printed = subprocess.run([folder / "both"], input=states.tobytes(), capture_output=True)
    assert printed.returncode == 0
    actions = np.array(printed.stdout.split(), int).reshape(-1, 2).T
    for flight, action in zip(flights, actions):
        states = flight_check.decisions(flight, flown.quaternion, flown.angular_velocity)
        assert exported.differing(states, action)[0] == 0
    assert np.mean(actions[0] != actions[1]) > 0.1


@pytest.fixture(scope="module")
def two_rates(tmp_path_factory):
    """Both rates exported into one folder, beside a program that uses both."""
    folder = tmp_path_factory.mktemp("rates")
    for prefix, frameskip in RATES.items():
        flags = ["--prefix", prefix, "--frameskip", frameskip]
        assert export_script.main(arguments(folder, *flags)) == 0
    (folder / "both.c").write_text(BOTH)
    return folder


@pytest.mark.parametrize("language", LANGUAGES)
def test_two_rates_link_into_one_program(two_rates, language):
    decisions(two_rates, (language, ["both.c", *(f"{prefix}_policy.c" for prefix in RATES)]))


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_c_objects_link_into_a_c_plus_plus_program(two_rates, language):
    policies = [f"{prefix}_policy.c" for prefix in RATES]
    decisions(two_rates, (language, ["both.c"]), ("c", policies))


def test_all_names_follow_the_prefix(two_rates):
    names = {path.name for path in two_rates.iterdir() if path.suffix in (".c", ".h")}
    expected = {f"{prefix}_{name[7:]}" for prefix in RATES for name in export_c.FILES}
    assert names == expected | {"both.c"}
    for name in expected:
        assert "attjax_" not in (two_rates / name).read_text().lower()


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_test_program_passes_in_each_language(tmp_path, language):
    exported.write(tmp_path, export_c.files(exported.load(PRECISE, 5), seed=0))
    assert exported.run_test_program(tmp_path, language=language).endswith("passed\n")


@pytest.mark.parametrize(
    "prefix",
    ["", "9a", "a b", "a-b", "Fast", "é", "_a", "a_", "a__b", "int", "namespace", "x" * 19, "a\n"],
)
def test_a_bad_prefix_is_refused(tmp_path, capsys, prefix):
    out = tmp_path / "out"
    error = one_line_error(export_script.main, arguments(out, "--prefix", prefix), capsys)
    assert "--prefix" in error and "a-z, 0-9" in error and not out.exists()


def test_onnx_and_stablehlo_files_have_the_prefix(tmp_path):
    for module in ("export_onnx", "export_stablehlo"):
        module = pytest.importorskip(f"attjax.{module}", exc_type=ImportError)
        names = module.files(exported.untrained("state", (16,), 0.0), prefix="mine")
        assert list(names) == [name.replace("attjax", "mine") for name in module.FILES]


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(
    "name",
    ["a */ b", "a /* b", "*/*/", "/*/", "??/", "???/", "ends in \\", 'q"$x ${y}', "Ångström ☃",
     "attjax_x", "/" * 300, "??/ " * 60, "* / " * 80],
)  # fmt: skip
def test_any_name_of_a_spacecraft_compiles(tmp_path, name, language):
    flight = exported.untrained("state", (16,), 0.99, Spacecraft(name=name, duration=1))
    exported.write(tmp_path, export_c.files(flight, seed=0))
    for source in ("attjax_policy.c", "attjax_test.c"):
        exported.compile_c(tmp_path, "-c", source, language=language)
    header = (tmp_path / "attjax_policy.h").read_text()
    assert max(map(len, header.splitlines())) <= 100
    if name.isascii() and not {"*/", "/*", "??"} & {name[i : i + 2] for i in range(len(name))}:
        assert name in header or len(name) > 50


def test_the_inertia_is_told_to_its_last_digit():
    craft = Spacecraft(inertia=(0.87212345678, 0.1151, 0.79712345678))
    header = export_c.policy_files(exported.untrained("state", (16,), 0.9999999, craft))
    assert "(0.87212345678, 0.1151, 0.79712345678) kg m^2" in header["attjax_policy.h"]
    assert "0.9999999 times the rate limit" in header["attjax_policy.c"]


@exported.needs_compiler
@pytest.mark.parametrize("flag", ["-ffast-math", "-Ofast", "-ffinite-math-only"])
def test_a_compiler_that_ignores_nan_is_refused(tmp_path, flag):
    exported.write(tmp_path, export_c.policy_files(exported.untrained("state", (16,), 0.0)))
    with pytest.raises(AssertionError, match="a spoilt state would not lead to no torque"):
        exported.compile_c(tmp_path, flag, "-c", "attjax_policy.c")
