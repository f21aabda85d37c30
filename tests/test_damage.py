"""Damaged run folders: refused in one line, without a traceback, and left as they are."""

import json
import shutil
import subprocess
import sys

import pytest
from commands import ROOT, eval_script, train_script
from fuzzing import FUZZ, content, refused
from hypothesis import given, settings
from hypothesis import strategies as st

from attjax.config import presets
from attjax.config.settings import SUBJECT_OF
from attjax.runs import folder as run_folder

# Orbax leaves coroutines behind where a file is damaged; processes of their own show no sign of it.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5)),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
    max_leaves=5,
)


@st.composite
def damage(draw, names):
    """A function that damages one file of a run folder, and what it does."""
    name = draw(st.sampled_from(names))
    kind = draw(st.sampled_from(["remove", "empty", "cut", "flip", "garbage", "folder", "config"]))
    where, value = draw(st.floats(0, 1)), draw(JSON)
    garbage = draw(st.binary(max_size=200))
    keys = sorted([*presets.PRECISE.flat, "program", "format", "preset", "seed", "settings"])
    key = draw(st.sampled_from(keys))

    def apply(folder):
        path = folder / name
        data = path.read_bytes()
        position = int(where * (len(data) - 1)) if data else 0
        if kind in ("remove", "folder"):
            path.unlink()
            if kind == "folder":
                path.mkdir()
        elif kind == "config":
            path = folder / run_folder.CONFIG
            config = json.loads(path.read_text())
            (config if key in config else config["settings"][SUBJECT_OF[key]])[key] = value
            path.write_text(json.dumps(config))
        else:
            flipped = data[:position] + bytes(255 - b for b in data[position : position + 1])
            flipped += data[position + 1 :]
            cut = data[:position]
            path.write_bytes({"empty": b"", "cut": cut, "flip": flipped}.get(kind, garbage))

    return f"{kind} {key if kind == 'config' else name}", apply


def files(folder):
    """Names of the files of a run."""
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())


def test_damaged_run_folders(trained, no_work, tmp_path):
    count = {True: 0, False: 0}

    @settings(max_examples=100, **FUZZ)
    @given(damage(files(trained[0])))
    def check(described):
        what, apply = described
        folder = tmp_path / "run"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(trained[0], folder)
        apply(folder)
        before = content(folder)
        common = ["--device", "cpu", "--checkpoint", str(folder)]
        count[refused(eval_script.main, [*common, "--episodes", "2"])] += 1
        assert content(folder) == before, what
        if refused(train_script.main, [*common, "--resume"]):
            count[True] += 1
            assert content(folder) == before, what
        else:
            count[False] += 1

    check()
    assert min(count.values()) > 20


REAL = [
    ("policy", "empty"), ("learner", "empty"), ("config.json", "empty"), ("metrics.csv", "garbage"),
    ("policy", "remove"), ("learner", "remove"), ("config.json", "garbage"), ("policy", "garbage"),
    ("learner", "garbage"), ("metrics.csv", "empty"),
]  # fmt: skip


@pytest.mark.parametrize("part, kind", REAL, ids=map("-".join, REAL))
@pytest.mark.parametrize("script", ["eval.py", "train.py"])
def test_damaged_run_folders_in_a_process_of_its_own(trained, tmp_path, script, part, kind):
    """Where threads and interpreters end, too, there is no traceback."""
    folder = tmp_path / "run"
    shutil.copytree(trained[0], folder)
    paths = [folder / name for name in files(folder) if part in name]
    for path in paths:
        if kind == "remove":
            path.unlink()
        else:
            path.write_bytes(b"" if kind == "empty" else b"\x80garbage\n" * 9)
    before = content(folder)
    arguments = ["--resume"] if script == "train.py" else ["--episodes", "2", "--duration", "1"]
    command = [sys.executable, ROOT / script, "--device=cpu", "--checkpoint", folder, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    harmless = {"eval.py": ["learner", "metrics.csv"], "train.py": ["policy"]}[script]
    if part in harmless or (script, part, kind) == ("train.py", "metrics.csv", "empty"):
        assert done.returncode == 0, done.stderr
    else:
        assert done.returncode == 2
        assert done.stdout == "" and done.stderr.count("\n") == 1, done.stderr
    if script == "eval.py" or done.returncode:
        assert content(folder) == before
    assert "Traceback" not in done.stderr
