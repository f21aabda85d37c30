"""Running train.py, eval.py and export.py, as processes and in this one."""

import subprocess
import sys
from pathlib import Path

import pytest

from attjax.commands import eval as eval_script
from attjax.commands import export as export_script
from attjax.commands import train as train_script

__all__ = ["eval_script", "export_script", "train_script"]

ROOT = Path(__file__).parents[2]
TINY = [
    "--device=cpu", "--frameskips=5,20", "--num-envs=16", "--rollout-length=8",
    "--minibatch-size=32", "--hidden-sizes=16", "--updates-per-block=2",
]  # fmt: skip
STEPS_PER_UPDATE = 16 * 8


def run(script, *arguments, **options):
    command = [sys.executable, str(ROOT / script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, **options)


def python(code, *arguments, **options):
    """A process that finds attjax and the programs."""
    code = f"import sys\nsys.path.insert(0, {str(ROOT)!r})\n{code}"
    command = [sys.executable, "-c", code, *map(str, arguments)]
    options = {"capture_output": True, "text": True, "timeout": 300} | options
    return subprocess.run(command, **options)


def one_line_error(main, arguments, capsys):
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    output = capsys.readouterr()
    assert exit_.value.code == 2
    assert output.out == ""
    assert output.err.count("\n") == 1 and ": error: " in output.err
    return output.err
