"""Shapes in signatures are checked under the tests: which modules' are, and by what."""

import jaxtyping

MODULES = (
    "attjax.dynamics.quaternion",
    "attjax.dynamics.rigid_body",
    "attjax.dynamics.numerics",
    "attjax.dynamics.propagation",
    "attjax.envs.observation",
    "attjax.envs.reward",
    "attjax.control.features",
    "attjax.ppo.losses",
)
"""Those of docs/decisions/array-checks.md."""

TYPECHECKER = "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))"
"""To which an int is a float too, as to Python's typing."""


def install() -> None:
    """Check them from now on; before attjax is imported."""
    jaxtyping.install_import_hook(MODULES, TYPECHECKER)
