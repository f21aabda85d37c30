"""Two policies as one: for any spacecraft, and for what is left of it when an axis is dead."""

import dataclasses
from collections.abc import Callable

import chex
import jax.numpy as jnp

from attjax.control import torque_order
from attjax.envs.context import Context
from attjax.ppo.networks import Policy


@dataclasses.dataclass(frozen=True)
class Crew:
    """Of two universal policies the one that is for the spacecraft as it is believed to be.

    It has the methods of a :class:`attjax.ppo.networks.Policy` that decide, of parameters
    {"whole": ..., "crippled": ...}.

    Attributes:
        whole: for three torque axes.
        crippled: for two, where the torques about the third are dead.
    """

    whole: Policy
    crippled: Policy

    is_universal = True

    def act(self, params: dict, observation: chex.Array, context: Context) -> chex.Array:
        """As :meth:`Policy.act`."""
        return self._either(
            params, context, lambda policy, params: policy.act(params, observation, context)
        )

    def draw(
        self, params: dict, key: chex.PRNGKey, observation: chex.Array, context: Context
    ) -> chex.Array:
        """As :meth:`Policy.draw`."""
        return self._either(
            params, context, lambda policy, params: policy.draw(params, key, observation, context)
        )

    def scores(self, params: dict, observation: chex.Array, context: Context) -> chex.Array:
        """As :meth:`Policy.scores`."""
        return self._either(
            params, context, lambda policy, params: policy.scores(params, observation, context)
        )

    def _either(
        self, params: dict, context: Context, decide: Callable[[Policy, dict], chex.Array]
    ) -> chex.Array:
        whole = decide(self.whole, params["whole"])
        crippled = decide(self.crippled, params["crippled"])
        return jnp.where(torque_order.is_crippled(context), crippled, whole)
