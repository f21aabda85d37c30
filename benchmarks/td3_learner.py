"""rejax's TD3 with the predecessor's networks and numbers; td3.py runs it where rejax is installed.

Networks, exploration, targets, losses and Adam are rejax's. Four things are not, none of which
the recipe tells of: an episode that the time limit cut has a future, as in the library that the
recipe's numbers are of, unless asked otherwise (in rejax it is learned as an end), a minibatch is
drawn with replacement (rejax draws without, at the cost of a random number for every row of the
buffer), the networks are updated apart from the buffer, which XLA would else copy in each step,
and the delay counts gradient steps, however many spacecraft there are.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import rejax
from flax import linen as nn
from flax import struct
from rejax.networks import DeterministicPolicy, QNetwork

from attjax import AttitudeEnv
from attjax.envs.parameters import EnvState
from attjax.runs import foreign
from attjax.wrappers.gymnax import FiveValueEnv

HIDDEN_SIZES = (400, 300)
NUM_ENVS = 4
"""Spacecraft side by side: as many agent steps, and gradient steps, of an iteration."""

WARM_UP = 10_000
"""Agent steps with uniformly random torques before the first gradient step."""

EXPLORATION_NOISE = 0.1
NUMBERS = {
    "learning_rate": 3e-4,
    "gamma": 0.99,
    "polyak": 0.995,
    "exploration_noise": EXPLORATION_NOISE,
    "target_noise": 0.2,
    "target_noise_clip": 0.5,
    "policy_delay": 2,
    "batch_size": 100,
    "buffer_size": 500_000,
}
"""The predecessor's, by rejax's names."""


@struct.dataclass
class Led:
    """Where a step led to.

    Attributes:
        state: the environment's, of a new episode if the old one is over.
        observation: (11,) the one before any reset.
        ended: whether it has no future.
    """

    state: EnvState
    observation: jax.Array
    ended: jax.Array


class Task(FiveValueEnv):
    """The environment, whose state tells an episode that the time limit cut from one that ended.

    Args:
        env: with continuous actions.
        reward_scale: factor of the reward.
        time_limit_terminates: whether the time limit is learned as an end.
    """

    def __init__(self, env: AttitudeEnv, reward_scale: float, time_limit_terminates: bool):
        super().__init__(env, reward_scale)
        self._time_limit_terminates = time_limit_terminates

    def reset(self, key, params=None):
        """Observation and state of a new episode."""
        observation, state = super().reset(key, params)
        return observation, Led(state, observation, jnp.zeros((), bool))

    @functools.partial(jax.jit, static_argnames="self")
    def step(self, key, state, action, params=None):
        """As of any five-value environment."""
        observation, inner, reward, done, info = super().step(key, state.state, action, params)
        ended = done if self._time_limit_terminates else info["terminated"]
        return observation, Led(inner, info["final_observation"], ended), reward, done, info


class TD3(rejax.TD3):
    """One gradient step of the critics for each agent step, one of the actor for each second."""

    def iterate(self, state, uniform: bool = False):
        """An agent step of each spacecraft, and as many gradient steps unless it is warm-up."""
        state, transitions = self.collect_transitions(state, uniform=uniform)
        led = state.env_state
        transitions = transitions._replace(next_obs=led.observation, done=led.ended)
        buffer = state.replay_buffer.extend(transitions)
        if not uniform:
            rng, key = jax.random.split(state.rng)
            shape = self.num_envs // self.policy_delay, self.policy_delay, self.batch_size
            rows = jax.random.randint(key, shape, 0, buffer.num_entries)
            batches = jax.tree.map(lambda column: column[rows], buffer.data)
            networks = state.replace(replay_buffer=None, rng=rng)
            state, _ = jax.lax.scan(self.learn, networks, batches)
        return state.replace(replay_buffer=buffer)

    def learn(self, state, batches):
        """The critics from each of the minibatches, the actor and the targets after the last."""
        for index in range(self.policy_delay):
            batch = jax.tree.map(lambda column: column[index], batches)  # noqa: B023
            state = state.replace(rng=jax.random.split(state.rng)[0])
            state = self.update_critic(state, batch)
        state = self.update_actor(state, batch)
        return state.replace(
            critic_target_params=self._averaged(state.critic_target_params, state.critic_ts),
            actor_target_params=self._averaged(state.actor_target_params, state.actor_ts),
        ), None

    def _averaged(self, target, network):
        mix = functools.partial(_mix, self.polyak)
        return jax.tree.map(mix, target, network.params)


def _mix(share, old, new):
    return share * old + (1 - share) * new


class Learner:
    """TD3 and its state.

    Args:
        task: what it learns.
        seed: of networks, exploration and episodes.
    """

    def __init__(self, task: Task, seed: int):
        given = {"env": task, "num_envs": NUM_ENVS, "num_epochs": NUM_ENVS}
        bounds = -np.ones(3, np.float32), np.ones(3, np.float32)
        self._td3 = TD3.create(**given, **NUMBERS).replace(
            actor=DeterministicPolicy(3, bounds, HIDDEN_SIZES, nn.relu),
            critic=QNetwork(HIDDEN_SIZES, nn.relu),
        )
        state = self._td3.init_state(jax.random.PRNGKey(seed))
        self.state = jax.tree.map(lambda x: jnp.array(x, copy=True), state)  # each once: donated
        self._run = jax.jit(self._iterations, static_argnums=1, donate_argnums=0)

    def _iterations(self, state, uniform, count):
        def body(_, state):
            return self._td3.iterate(state, uniform)

        return jax.lax.fori_loop(0, count, body, state)

    @property
    def agent_steps(self) -> int:
        """Of all spacecraft, so far."""
        return int(self.state.global_step)

    def advance(self, agent_steps: int) -> None:
        """Go on until there are so many agent steps, warm-up first."""
        for uniform, until in ((True, min(WARM_UP, agent_steps)), (False, agent_steps)):
            count = -(-(until - self.agent_steps) // NUM_ENVS)
            if count > 0:
                self.state = jax.block_until_ready(self._run(self.state, uniform, count))

    @property
    def actor(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """Kernel (inputs, outputs) and bias (outputs,) of each of its layers."""
        layers = self.state.actor_ts.params["params"]
        names = [f"Dense_{index}" for index in range(len(HIDDEN_SIZES) + 1)]
        return [(np.asarray(layers[n]["kernel"]), np.asarray(layers[n]["bias"])) for n in names]

    def controller(self) -> jax.tree_util.Partial:
        """The actor, as ``act(observation, context) -> (3,)`` torque fractions."""
        return jax.tree_util.Partial(self._act, self.state.actor_ts.params)

    def _act(self, params, observation, context):
        del context
        return self._td3.actor.apply(params, observation[None])[0]


def as_run(learner: Learner):
    """What a checkpoint keeps of it: the actor, exploring as here, as a policy of ours."""
    params = foreign.gaussian_params(learner.actor, EXPLORATION_NOISE)
    return foreign.learner(params, learner.agent_steps // NUM_ENVS)
