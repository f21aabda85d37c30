"""The flight loop of a training run."""

from pathlib import Path

import jax

from attjax.control.assured import Assurance
from attjax.control.flight_loop import FlightLoop, flight_loop
from attjax.ppo.crew import Crew
from attjax.ppo.networks import Policy
from attjax.runs.checkpoint import best, restore_network
from attjax.runs.folder import FolderError

TWO_TORQUES = "two-torques"
"""Folder in that of a universal policy's run, of the run of one for what has lost an axis."""


def load_flight_loop(
    folder: str | Path,
    *,
    use_best: bool = False,
    adapts: bool = False,
    assurance: Assurance | None = None,
) -> FlightLoop:
    """The policy of a training run with estimator and predictor, and an assurance if asked for.

    Args:
        folder, use_best: as of :func:`attjax.load_policy`.
        adapts: whether inertia, torques and delay are identified in flight. If an axis is found to
            be dead, the policy in the folder "two-torques" takes over, where there is one.
        assurance: that ranks its actions by the policy's logits.

    Raises:
        FolderError: the folder holds no checkpoint, or an unreadable one.

    Example:
        >>> import attjax
        >>> loop = attjax.load_flight_loop("pretrained/precise")
        >>> attjax.evaluate(loop, attjax.AttitudeEnv(frameskip=20), episodes=10)["success_rate"]
        1.0
    """
    policy, params = network(Path(folder), use_best=use_best, adapts=adapts)
    act, scores = (jax.tree_util.Partial(x, params) for x in (policy.act, policy.scores))
    return flight_loop(act, adapts=adapts, assurance=assurance, scores=scores)


def companion(folder: Path) -> Path | None:
    """The folder of the policy that takes over where an axis is dead; None: there is none."""
    beside = folder / TWO_TORQUES
    return beside if beside.is_dir() else None


def network(
    folder: Path, *, use_best: bool = False, adapts: bool = False
) -> tuple[Policy | Crew, dict]:
    """The policy of a training run, as it flies, and its parameters.

    Args:
        folder, use_best, adapts: as of :func:`load_flight_loop`.

    Raises:
        FolderError: as of :func:`load_flight_loop`, or the other policy is not a universal one.
    """
    policy, params = restore_network(folder, best(folder) if use_best else None)
    beside = companion(folder)
    if beside is None or not (adapts and policy.is_universal):
        return policy, params
    other, others = restore_network(beside, best(beside) if use_best else None)
    if not other.is_universal:
        raise FolderError(f"{beside} holds a policy of one spacecraft; it must be a universal one")
    return Crew(policy, other), {"whole": params, "crippled": others}
