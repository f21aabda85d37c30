"""Random command lines and damaged run folders: no traceback, no file changed that should not be.

Whatever comes in, train.py and eval.py either accept it or end with one line and exit status 2.
The work behind accepted input is left out here; other tests do it.
"""

import contextlib
import io
import itertools
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from commands import ROOT, eval_script, train_script
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from attjax import evaluation, presets, run_folder, training
from attjax.settings import Settings

# Orbax leaves coroutines behind where a file is damaged; processes of their own show no sign of it.
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")

FUZZ = {
    "deadline": None,
    "database": None,
    "derandomize": True,
    "suppress_health_check": list(HealthCheck),
}
NUMBERS = st.one_of(
    st.integers(-3, 3),
    st.integers(-(2**70), 2**70),
    st.floats(),
    st.sampled_from(["0", "1e400", "-0.0", "1_000", "0x10", "٣", "1,2", "5,,7", ",", "nan,1", ""]),
).map(str)
WORDS = st.one_of(
    NUMBERS,
    st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=8),
    st.sampled_from(["paper", "precise", "logarithmic", "multiscale", "cpu", "policy", "--resume"]),
)
SETTINGS = ["--" + name.replace("_", "-") for name in Settings.__dataclass_fields__]
PLAUSIBLE = {"--" + name.replace("_", "-"): value for name, value in vars(presets.PRECISE).items()}
PLAUSIBLE |= {
    "--preset": "paper", "--seed": 1, "--save-every": 2.5, "--frameskip": 7, "--duration": 1.5,
    "--controller": "feedback", "--json": "result.json", "--plot": "figures", "--episodes": 3,
}  # fmt: skip
TRAIN_FLAGS = [*SETTINGS, "--preset", "--seed", "--save-every", "--nonsense"]
EVAL_FLAGS = ["--episodes", "--frameskip", "--duration", "--seed", "--controller"]
EVAL_FLAGS += ["--json", "--plot", "--nonsense"]
TRAIN_SWITCHES = [["--resume"], ["--overwrite"], ["--overwrite"], ["--debug-nans"], []]
EVAL_SWITCHES = [["--compare"], ["--best"], ["-v"], [], []]


def command_lines(flags, switches):
    """A switch, and up to three flags with values, random ones or such as they should be."""

    def plausible(flag):
        value = PLAUSIBLE.get(flag, "")
        return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)

    random = st.tuples(st.sampled_from(flags), WORDS)
    sound = st.sampled_from(flags).map(lambda flag: (flag, plausible(flag)))
    options = st.lists(st.one_of(sound, random), max_size=3)
    return st.tuples(options, st.sampled_from(switches)).map(
        lambda parts: [*itertools.chain(*parts[0]), *parts[1]]
    )


class Accepted(Exception):
    """The input led to the work."""


@pytest.fixture
def no_work(monkeypatch):
    def accept(*_, **__):
        raise Accepted

    monkeypatch.setattr(evaluation, "fly", accept)
    monkeypatch.setattr(training.Run, "train", accept)
    monkeypatch.setattr(training.Run, "describe", lambda *_: None)


def refused(main, arguments) -> bool:
    """Call main; whether it refused, which must take one line on stderr and exit status 2."""
    output, errors = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
            main(arguments)
    except Accepted:
        return False
    except SystemExit as exit_:
        text = errors.getvalue()
        assert exit_.code == 2, (arguments, text)
        assert text.count("\n") == 1 and ": error: " in text, (arguments, text)
        assert output.getvalue() == ""
        return True
    raise AssertionError(f"{arguments} was neither refused nor accepted")


def content(folder: Path) -> dict:
    """What is in a folder."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


@pytest.fixture(scope="module")
def playground(trained, tmp_path_factory):
    """A copy of a run, in which there are files of the user's, too."""
    folder = tmp_path_factory.mktemp("fuzz") / "run"
    shutil.copytree(trained[0], folder)
    (folder / "notes.txt").write_text("precious")
    return folder


def test_random_training_command_lines(playground, no_work, monkeypatch):
    def no_run(*_, **__):
        raise Accepted

    monkeypatch.setattr(training, "Run", no_run)
    before, count = content(playground), {True: 0, False: 0}

    @settings(max_examples=500, **FUZZ)
    @given(command_lines(TRAIN_FLAGS, TRAIN_SWITCHES))
    def check(arguments):
        given_folder = ["--device", "cpu", "--checkpoint", str(playground)]
        was_refused = refused(train_script.main, [*arguments, *given_folder])
        count[was_refused] += 1
        if was_refused or "--resume" in arguments:
            assert content(playground) == before, arguments
        else:  # it was overwritten, as it asked
            assert content(playground)["notes.txt"] == b"precious"
            for name, data in before.items():
                path = playground / name
                path.mkdir(parents=True, exist_ok=True) if data is None else path.write_bytes(data)

    check()
    assert min(count.values()) > 50


def test_random_evaluation_command_lines(playground, no_work, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before, count = content(playground), {True: 0, False: 0}

    @settings(max_examples=350, **FUZZ)
    @given(command_lines(EVAL_FLAGS, EVAL_SWITCHES))
    def check(arguments):
        given_folder = ["--device", "cpu", "--checkpoint", str(playground)]
        count[refused(eval_script.main, [*arguments, *given_folder])] += 1
        assert content(playground) == before, arguments
        assert all(path.is_dir() for path in tmp_path.rglob("*")), arguments  # of --plot

    check()
    assert min(count.values()) > 50


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
    keys = sorted([*vars(presets.PRECISE), "program", "format", "preset", "seed", "settings"])
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
            (config if key in config else config["settings"])[key] = value
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
