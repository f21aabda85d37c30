"""The flight loop of a training run."""

from pathlib import Path

import jax

from attjax.control.assured import Assurance
from attjax.control.flight_loop import FlightLoop, flight_loop
from attjax.runs.checkpoint import best, load_policy, restore_network


def load_flight_loop(
    folder: str | Path, *, use_best: bool = False, assurance: Assurance | None = None
) -> FlightLoop:
    """The policy of a training run with estimator and predictor, and an assurance if asked for.

    Args:
        folder, use_best: as of :func:`attjax.load_policy`.
        assurance: that ranks its actions by the policy's logits.

    Raises:
        FolderError: the folder holds no checkpoint, or an unreadable one.

    Example:
        >>> import attjax
        >>> loop = attjax.load_flight_loop("pretrained/precise")
        >>> attjax.evaluate(loop, attjax.AttitudeEnv(frameskip=20), episodes=10)["success_rate"]
        1.0
    """
    policy = load_policy(folder, use_best=use_best)
    if assurance is None:
        return flight_loop(policy)
    folder = Path(folder)
    scores = policy_scores(folder, best(folder) if use_best else None)
    return flight_loop(policy, assurance=assurance, scores=scores)


def policy_scores(folder: Path, update: int | None = None) -> jax.tree_util.Partial:
    """The logits of a saved policy, ``scores(observation, context) -> (actions,)``.

    Args:
        folder: of its run.
        update: of the checkpoint; None: the newest.

    Raises:
        FolderError: as of :func:`load_flight_loop`.
    """
    policy, params = restore_network(folder, update)
    return jax.tree_util.Partial(policy.scores, params)
