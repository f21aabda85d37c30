"""Training from Python or from the command line: ``attjax.train``."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from attjax.config import run as run_config
from attjax.config.settings import Settings
from attjax.runs import beginning, build, origin
from attjax.runs import folder as run_folder
from attjax.runs.keeper import Keeper, Place
from attjax.runs.run import Diverged, Run
from attjax.spacecraft import Spacecraft


class Observer:
    """Hears of a run while it trains; a subclass says what it does with that.

    A run that is done, has been asked to stop or has failed ends with :meth:`ended`.
    """

    def started(self, run: Run, lengthened_from: Settings | None) -> None:
        """It is at its start, or where it goes on; with the settings that had a smaller total."""

    def compiled(self, run: Run, seconds: float | None) -> None:
        """Its program is compiled; None: there was nothing left to compile for."""

    def block(self, row: dict) -> None:
        """A block of updates is done, with this row of metrics."""

    def wants_to_stop(self) -> bool:
        """Whether the run is to end where it can go on."""
        return False

    def ended(self) -> None:
        """No block follows."""


class _Callback(Observer):
    """A function of a row of metrics, which returns True for the run to stop."""

    def __init__(self, function):
        self._function, self._stops = function, False

    def block(self, row):
        self._stops = bool(self._function(row))

    def wants_to_stop(self):
        return self._stops


def train(
    preset: str | Settings | None = None,
    *,
    seed: int | None = None,
    spacecraft: Spacecraft | None = None,
    folder: str | Path | Place | None = None,
    callback: Callable[[dict], bool | None] | Observer | None = None,
    debug_nans: bool = False,
    **settings: Any,
) -> Run:
    """Train a policy by PPO.

    Args:
        preset: the recipe, by name, or settings of one's own; by default "precise", or what the
            folder's run, or that of ``resume_from``, was started with.
        seed: of everything random; 0 by default.
        spacecraft: what flies, and its task; LM50, the paper's, by default.
        folder: to keep the run in, as ``train.py --checkpoint`` does; a :class:`Place` says how,
            and whether to go on with the run that it holds. None: nothing is written.
        callback: called with each block's row of metrics; where it returns True, the run ends
            there. An :class:`Observer` hears more.
        debug_nans: check every operation, and name the first that makes a NaN; slow.
        settings: by name, in place of the preset's: any of ``train.py --help``; ``world``, a
            :class:`attjax.world.World` or the name of one, "ideal" by default; ``resume_from``, the
            folder of a run to begin with the networks of, and with all else that is not given.

    Returns:
        The run: ``policy``, ``metrics``, ``env``, and all else of :class:`attjax.runs.run.Run`.

    Raises:
        ValueError: something given is not as said.
        FolderError: the folder holds a run already, or cannot be written.
        Diverged: training met a number that is not finite.

    Example:
        >>> run = train("paper-fast", total_steps=2048, num_envs=64, rollout_length=16)
        >>> run.agent_steps, run.env.frameskip
        (2048, 20)
    """
    given = _given(settings, preset=preset, seed=seed, spacecraft=spacecraft)
    observer = _observer(callback)
    if folder is None:
        return _train_in_memory(given, observer, debug_nans)
    place = folder if isinstance(folder, Place) else Place(folder=Path(folder))
    return _train_in_folder(place, given, observer, debug_nans)


def _given(settings, **start):
    """What is asked of the run, by name: preset, seed and spacecraft, and settings."""
    if isinstance(start["preset"], Settings):
        settings = start["preset"].flat | settings
        start |= {"preset": run_config.CUSTOM}
    return {name: x for name, x in (start | settings).items() if x is not None}


def _observer(callback):
    if isinstance(callback, Observer):
        return callback
    return Observer() if callback is None else _Callback(callback)


def _train_in_memory(given, observer, debug_nans):
    config = origin.new(given)
    setup = build.of_config(config)
    run = Run(config, setup, beginning.networks(config, setup))
    observer.started(run, None)
    _train(run, observer, None, debug_nans)
    return run


def _train_in_folder(place, given, observer, debug_nans):
    with run_folder.opened(place.folder):
        keeper = Keeper(place, given)
        observer.started(keeper.run, keeper.lengthened_from)
        with keeper:
            if keeper.run.config.resumed_from is not None:
                keeper.save()  # so that it needs the other run's folder no more
            _train(keeper.run, observer, keeper, debug_nans)
            keeper.save()
    return keeper.run


def _train(run, observer, keeper, debug_nans):
    """Run blocks until the end, or until the observer wants to stop."""
    start, compiled = time.monotonic(), None
    if not run.is_complete and not observer.wants_to_stop():
        compiled = run.compiled(debug_nans)
    observer.compiled(run, compiled and time.monotonic() - start)
    try:
        while compiled and not run.is_complete and not observer.wants_to_stop():
            row = run.train_block(compiled)
            if keeper:
                keeper.add(row)
            observer.block(row)
    except Diverged as error:
        kept = f"; {keeper.describe_saved()}" if keeper else ""
        raise Diverged(f"{error}{kept}") from None
    finally:
        observer.ended()
