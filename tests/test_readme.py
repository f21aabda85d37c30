"""The README's Python example runs, and its tables name what is there."""

import re
from pathlib import Path

from attjax.presets import PRESETS

README = (Path(__file__).parent.parent / "README.md").read_text()


def test_python_examples_run():
    examples = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert examples
    for example in examples:
        namespace = {}
        exec(example, namespace)
        assert namespace["states"].time.tolist() == [1] * 4096


def test_every_preset_is_described():
    for preset in PRESETS:
        assert f"| `{preset}` |" in README
