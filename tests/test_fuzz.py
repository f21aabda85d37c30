"""Random command lines: no traceback, no file changed that should not be.

Whatever comes in, train.py and eval.py either accept it or end with one line and exit status 2.
The work behind accepted input is left out here; other tests do it.
"""

import itertools
import shutil

import pytest
from commands import eval_script, train_script
from fuzzing import FUZZ, Accepted, content, refused
from hypothesis import given, settings
from hypothesis import strategies as st

from attjax.config import presets
from attjax.config.settings import FIELDS
from attjax.runs import keeper

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
SETTINGS = ["--" + name.replace("_", "-") for name in FIELDS]
PLAUSIBLE = {"--" + name.replace("_", "-"): value for name, value in presets.PRECISE.flat.items()}
PLAUSIBLE |= {
    "--preset": "paper", "--seed": 1, "--save-every": 2.5, "--frameskip": 7, "--duration": 1.5,
    "--controller": "feedback", "--json": "result.json", "--plot": "figures", "--episodes": 3,
    "--playback": "slews.html", "--world": "ideal",
}  # fmt: skip
TRAIN_FLAGS = [*SETTINGS, "--preset", "--seed", "--save-every", "--world", "--nonsense"]
EVAL_FLAGS = ["--episodes", "--frameskip", "--duration", "--seed", "--controller"]
EVAL_FLAGS += ["--world", "--json", "--plot", "--playback", "--nonsense"]
TRAIN_SWITCHES = [
    ["--resume"],
    ["--overwrite"],
    ["--overwrite"],
    ["--debug-nans"],
    ["--tensorboard"],
    [],
]
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

    monkeypatch.setattr(keeper, "Run", no_run)
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
