"""The notebooks run, shortened, each in a process of its own, and hold no outputs."""

import json
import os
import re

import pytest
from commands import ROOT, python

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
SHORT = {"STEPS": "1", "EPISODES": "20"}
SMALL = "num_envs=256, rollout_length=16, minibatch_size=256, "


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    cells = [c for c in json.loads(path.read_text())["cells"] if c["cell_type"] == "code"]
    assert not any(cell["outputs"] or cell["execution_count"] for cell in cells)
    code = "\n".join("".join(cell["source"]) for cell in cells)
    for name, value in SHORT.items():
        code = re.sub(rf"(?m)^{name} = .+$", f"{name} = {value}", code)
    code = code.replace("total_steps=STEPS, ", f"total_steps=STEPS, {SMALL}")
    code = code.replace("total_steps=STEPS,\n", f"total_steps=STEPS, {SMALL}\n")
    done = python(code, cwd=ROOT, env=os.environ | {"MPLBACKEND": "agg", "JAX_PLATFORMS": "cpu"})
    assert done.returncode == 0, done.stderr


def test_there_are_notebooks():
    assert len(NOTEBOOKS) >= 3
