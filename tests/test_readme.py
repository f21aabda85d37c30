"""The README's Python example runs, and its tables name what is there."""

import re
from pathlib import Path

import pytest

from attjax.presets import PRESETS

README = (Path(__file__).parent.parent / "README.md").read_text()


EXAMPLES = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
PEERS = ("gymnasium", "stable_baselines3", "gymnax", "rejax")


def test_the_library_example_runs():
    namespace = {}
    exec(EXAMPLES[0], namespace)
    assert namespace["states"].time.tolist() == [1] * 4096


@pytest.mark.parametrize("example", EXAMPLES[1:])
def test_examples_with_peers_run(example):
    for peer in PEERS:
        if peer in example:
            pytest.importorskip(peer)
    exec(example, {})


def test_every_preset_is_described():
    for preset in PRESETS:
        assert f"| `{preset}` |" in README
