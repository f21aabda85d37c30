"""What train.py says of a preset as a run begins."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from attjax.commands.training_output import Terminal
from attjax.config.presets import PRESETS
from attjax.spacecraft import LM50


@pytest.mark.parametrize(
    ("preset", "platform", "named"),
    [
        ("precise", "gpu", "precise-gpu"),
        ("precise", "cpu", None),
        ("precise-gpu", "gpu", None),
        ("paper", "cpu", "paper-gae"),
        ("paper", "gpu", "paper-gae"),
        ("paper-fast", "cpu", None),
    ],
)
def test_it_names_the_preset_that_one_might_rather_take(preset, platform, named, capsys):
    device = SimpleNamespace(platform=platform, device_kind="a device")
    settings = PRESETS[preset]
    config = SimpleNamespace(
        preset=preset, spacecraft=LM50, seed=0, settings=settings, resumed_from=None
    )
    setup = SimpleNamespace(num_devices=1)
    run = SimpleNamespace(config=config, total_steps=1, setup=setup, update=0)
    Terminal(Path("folder"), device, None).started(run, None)
    first, *remarks = capsys.readouterr().out.splitlines()
    assert first.startswith(f"preset {preset}, LM50")
    assert len(remarks) == (named is not None)
    assert all(named in remark for remark in remarks)
