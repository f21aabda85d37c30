import dataclasses
import json
import operator
import re

import numpy as np
import pytest
from commands import ROOT

from attjax.config import presets, settings
from attjax.config.presets import PAPER, PAPER_FAST, PAPER_GAE, PRECISE, PRESETS


def test_paper_presets_hold_what_the_paper_names():
    """Tables 3 and 4, section 2.5."""
    for preset in (PAPER, PAPER_GAE, PAPER_FAST):
        task, network, ppo = preset.task, preset.network, preset.ppo
        assert network.hidden_sizes == (400, 300)
        assert (ppo.discount, ppo.discount_period) == (0.99, 0)
        assert (ppo.learning_rate, ppo.final_learning_rate) == (3e-4, 1e-5)
        assert (ppo.clip, ppo.entropy_coefficient) == (0.2, 1e-4)
        assert (task.frameskips, task.reward, network.features) == ((20,), "paper", "state")
    assert PAPER.task.time_limit_terminates and PAPER.network.rate_margin == 0
    ppo = PAPER.ppo
    assert (ppo.num_envs, ppo.rollout_length, ppo.minibatch_size) == (30, 500, 128)
    assert ppo.num_updates == 4340 and ppo.gae_lambda == 1
    assert PAPER.replace(gae_lambda=0.95) == PAPER_GAE


@pytest.mark.parametrize("preset", PRESETS.values())
def test_settings_survive_json(preset):
    chosen = preset.replace(num_envs=600, total_steps=123)
    restored = settings.from_json(json.loads(json.dumps(dataclasses.asdict(chosen))))
    assert restored == chosen


def test_total_steps_round_up_to_whole_updates():
    chosen = PRECISE.replace(num_envs=10, rollout_length=10, minibatch_size=10, total_steps=101)
    assert chosen.ppo.num_updates == 2 and chosen.ppo.minibatches == 10


@pytest.mark.parametrize("integer", [np.int64, np.uint16, np.array], ids=lambda x: x.__name__)
def test_numbers_of_numpy_are_numbers(integer):
    chosen = PRECISE.replace(
        num_envs=integer(64), frameskips=[integer(5), integer(20)], clip=np.float32(0.25),
        minibatch_size=integer(64), normalize_advantage=np.True_,
    )  # fmt: skip
    plain = PRECISE.replace(
        num_envs=64, frameskips=(5, 20), clip=0.25, minibatch_size=64,
        normalize_advantage=True,
    )  # fmt: skip
    assert chosen == plain and hash(chosen) == hash(plain)
    assert json.dumps(dataclasses.asdict(chosen)) == json.dumps(dataclasses.asdict(plain))


@pytest.mark.parametrize(
    "name, value, allowed",
    [
        ("num_envs", 0, "an integer at least 1"),
        ("num_envs", 2.5, "an integer"),
        ("num_envs", True, "an integer"),
        ("num_envs", np.True_, "an integer"),
        ("num_envs", np.float64(64), "an integer"),
        ("clip", np.True_, "a number"),
        ("num_envs", 4, "at least 5, the number of frameskips"),
        ("frameskips", (), "integers at least 0 and below 10500"),
        ("frameskips", (5, -1), "integers at least 0"),
        ("frameskips", 5, "integers at least 0"),
        ("discount", 0.0, "a number above 0 and at most 1"),
        ("discount", float("nan"), "a number"),
        ("clip", 1.0, "below 1"),
        ("reward", "sparse", "one of paper, logarithmic"),
        ("normalize_advantage", "yes", "true or false"),
        ("minibatch_size", 10**9, "at most num_envs x rollout_length"),
    ],
)
def test_bad_values_are_refused_with_what_is_allowed(name, value, allowed):
    with pytest.raises(ValueError) as error:
        PRECISE.replace(**{name: value})
    assert str(error.value).startswith(name) and allowed in str(error.value)


def test_unknown_and_missing_names_are_refused():
    values = dataclasses.asdict(PRECISE)
    with pytest.raises(ValueError, match="gravity"):
        settings.from_json(values | {"world": {"gravity": 1}})
    del values["ppo"]["clip"]
    with pytest.raises(ValueError, match="clip"):
        settings.from_json(values)
    with pytest.raises(ValueError, match="gravity"):
        PRECISE.replace(gravity=1)


def test_every_name_has_one_subject():
    subjects = dataclasses.asdict(PRECISE).values()
    assert sum(map(len, subjects)) == len(settings.FIELDS)
    assert PRECISE.flat == {name: value for values in subjects for name, value in values.items()}
    assert PRECISE.replace() == PRECISE and PAPER.replace(**PRECISE.flat) == PRECISE


USES = [
    (path, *use)
    for path in sorted(ROOT.glob("benchmarks/*.py"))
    for use in re.findall(r"\b(PAPER|PAPER_FAST|PRECISE)((?:\.\w+)+)", path.read_text())
]


def test_benchmarks_read_what_presets_have():
    """Most of them need packages that are not here, and so do not run in the tests."""
    assert len(USES) > 10
    for path, preset, names in USES:
        try:
            operator.attrgetter(names[1:])(getattr(presets, preset))
        except AttributeError as error:
            pytest.fail(f"{path.name}: {preset}{names}: {error}")
