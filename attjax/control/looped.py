"""An environment in a flight loop: what an agent observes is what the loop's estimator believes."""

import dataclasses
from typing import Any

import chex

from attjax.control.flight_loop import FlightLoop, flight_loop
from attjax.control.memory import Memory
from attjax.envs.attitude import AttitudeEnv
from attjax.envs.parameters import EnvParams, EnvState, measured

LOOP: FlightLoop = flight_loop(None)
"""With the default estimator and predictor; whoever acts is outside it."""


class LoopedState(EnvState):
    """State of one spacecraft, and of its flight loop.

    Attributes:
        memory: of the loop, at the decision that follows; None where it remembers nothing.
    """

    memory: Memory | None = None


@dataclasses.dataclass(frozen=True)
class LoopedEnv:
    """An :class:`attjax.AttitudeEnv` as its flight loop's controller knows it.

    The observation is of the moment at which the torque begins that is about to be commanded.
    Rewards and outcomes are of the truth. All else is the environment's.

    Attributes:
        flown: the environment.

    Example:
        >>> import jax
        >>> from attjax.world import World
        >>> env = LoopedEnv(AttitudeEnv(frameskip=5, world=World.named("stress")))
        >>> observation, state = env.reset(jax.random.key(0), env.default_params)
        >>> observation.shape, int(state.memory.time)
        ((11,), 0)
    """

    flown: AttitudeEnv

    def __getattr__(self, name: str) -> Any:
        if name == "flown":  # of an object that is being copied
            raise AttributeError(name)
        return getattr(self.flown, name)

    def reset(self, key: chex.PRNGKey, params: EnvParams) -> tuple[chex.Array, LoopedState]:
        """Start an episode; as :meth:`attjax.AttitudeEnv.reset`."""
        _, state = self.flown.reset(key, params)
        observation, memory = LOOP.begun(measured(state), self.flown.context(params))
        return observation, LoopedState(**_fields(state), memory=memory)

    def step_env(
        self, key: chex.PRNGKey, state: LoopedState, action: chex.Numeric, params: EnvParams
    ) -> tuple[chex.Array, LoopedState, chex.Array, chex.Array, dict]:
        """One agent step without reset; as :meth:`attjax.AttitudeEnv.step_env`."""
        context, memory = self.flown.context(params), state.memory
        if memory is not None:  # an episode may begin at any time
            memory = memory.replace(time=state.time)
        memory = LOOP.after(memory, action, context)
        outside = EnvState(**_fields(state))
        _, following, *results = self.flown.step_env(key, outside, action, params)
        observation, memory = LOOP.later(memory, measured(following), context)
        return observation, LoopedState(**_fields(following), memory=memory), *results


def _fields(state):
    return {field.name: getattr(state, field.name) for field in dataclasses.fields(EnvState)}
