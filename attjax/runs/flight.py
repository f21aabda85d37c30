"""The flight loop of a training run."""

from pathlib import Path

from attjax.control.flight_loop import FlightLoop, flight_loop
from attjax.runs.checkpoint import load_policy


def load_flight_loop(folder: str | Path, *, use_best: bool = False) -> FlightLoop:
    """The policy of a training run with estimator and predictor.

    Args:
        folder, use_best: as of :func:`attjax.load_policy`.

    Raises:
        FolderError: the folder holds no checkpoint, or an unreadable one.

    Example:
        >>> import attjax
        >>> loop = attjax.load_flight_loop("pretrained/precise")
        >>> attjax.evaluate(loop, attjax.AttitudeEnv(frameskip=20), episodes=10)["success_rate"]
        1.0
    """
    return flight_loop(load_policy(folder, use_best=use_best))
