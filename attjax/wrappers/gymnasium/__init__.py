"""The slew task for Gymnasium: one spacecraft, or many in one jitted call.

Importing it registers ``attjax/Slew-v0``, and ``attjax/SlewContinuous-v0``, which has continuous
actions, for ``gymnasium.make`` and ``gymnasium.make_vec``; the id
``attjax.wrappers.gymnasium:attjax/Slew-v0`` imports it. It needs the extra ``gym``.
"""

import gymnasium

from attjax.wrappers.gymnasium.single import CONTINUOUS_ID, ID, SlewEnv
from attjax.wrappers.gymnasium.vector import SlewVectorEnv

__all__ = ["CONTINUOUS_ID", "ID", "SlewEnv", "SlewVectorEnv"]

gymnasium.register(
    ID,
    entry_point=f"{__name__}:SlewEnv",
    vector_entry_point=f"{__name__}:SlewVectorEnv",
)
gymnasium.register(
    CONTINUOUS_ID,
    entry_point=f"{__name__}:SlewEnv",
    vector_entry_point=f"{__name__}:SlewVectorEnv",
    kwargs={"actions": "continuous"},
)
