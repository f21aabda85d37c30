"""benchmarks/assurance.py: a run that was stopped goes on."""

import importlib
import json

import pytest
from commands import ROOT


@pytest.fixture
def script(monkeypatch):
    """The module, with three conditions that cost nothing to fly."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    module = importlib.import_module("assurance")
    names = [module.Condition(name, None, ()) for name in ("a", "b", "c")]
    monkeypatch.setattr(module, "conditions", lambda: names)
    return module


@pytest.fixture
def flown(script, monkeypatch):
    """The names of the conditions that are flown; "b" is interrupted at first."""
    names = []

    def fly(condition, flights, seed):
        if condition.name == "b" and "b" not in names:
            names.append("b")
            raise KeyboardInterrupt
        names.append(condition.name)
        broken = {"rate": 0, "wheels": 0, "cones": 0}
        told = {"most_rate": 0.9, "most_wheels": 0.0, "least_clearance_deg": None}
        row = {"condition": condition.name, "policy": "random", "proved": True, "seconds": 1.0}
        return [row | told | {"flights": flights, "broken": broken, "seed": seed}]

    monkeypatch.setattr(script, "fly", fly)
    return names


def test_conditions_that_were_flown_are_not_flown_again(script, flown, tmp_path, capsys):
    words = ["--flights", "600", "--json", str(tmp_path / "rows.json")]
    assert script.main(words) == 130
    assert script.main(words) == 0
    assert flown == ["a", "b", "b", "c"]
    rows = json.loads((tmp_path / "rows.json").read_text())
    assert [(row["condition"], row["seed"], row["flights"]) for row in rows] == [
        ("a", 0, 100), ("b", 1, 100), ("c", 2, 100),
    ]  # fmt: skip
    assert "0 broken of 300 flights" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("held", "said"),
    [
        ('[{"condition": "a", "flights": 7}]', "has rows of other than 100 flights each"),
        ('{"a": 1}', "holds no rows of flights"),
        ("[", "holds no rows of flights"),
    ],
)
def test_what_else_is_there_is_neither_continued_nor_lost(
    script, flown, tmp_path, capsys, held, said
):
    file = tmp_path / "rows.json"
    file.write_text(held)
    with pytest.raises(SystemExit) as end:
        script.main(["--flights", "600", "--json", str(file)])
    assert end.value.code == 2
    assert said in capsys.readouterr().err
    assert file.read_text() == held and not flown
