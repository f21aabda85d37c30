"""The attitude-control MDP of the paper (section 2.3), in gymnax 1.0's protocol."""

import dataclasses
from collections.abc import Callable

import chex
import jax.numpy as jnp
import numpy as np

from attjax.dynamics import quaternion as quaternions
from attjax.dynamics.fused_loop import apart
from attjax.dynamics.integration import AgentStep
from attjax.dynamics.numerics import squared_norm
from attjax.envs import initial_state, parameters, simulator, spaces, torques, worlds
from attjax.envs import observation as observations
from attjax.envs.context import Context, believed
from attjax.envs.keys import observation_key, steps_key
from attjax.envs.leaning import leaned
from attjax.envs.parameters import EnvParams, EnvState
from attjax.envs.restart import restart_one
from attjax.envs.reward import Transition, paper_reward
from attjax.spacecraft import INTEGRATION_STEP, LM50, Spacecraft
from attjax.values import ACTIONS, check_choice, check_share, check_truth, integer
from attjax.world import IDEAL, World


@dataclasses.dataclass(frozen=True)
class AttitudeEnv:
    """The slew task as an environment; by default exactly the paper's MDP.

    Attributes:
        frameskip: RK4 steps after the first in an agent step: 20 is 11.43 Hz, 5 is 40 Hz. With
            ``params.frameskip``, the most there may be.
        reward: function of a :class:`attjax.envs.reward.Transition`.
        initial_state: function of a key and parameters that draws the start of an episode.
        spacecraft: what flies, and its task; ``default_params`` are its.
        kinematic_factor: of Ω(ω) q in Eq. 9, ½; 1 in the authors' public code, where attitude
            turns twice as fast at the same ω.
        observes_quaternion_rate: whether Eq. 11's q̇ is observed; the authors' public code never
            works it out, and shows zeros.
        actions: "discrete", rows of the torque table; or "continuous", (3,) torques about the
            body axes at once, in fractions from −1 to 1 of the table's largest, clipped there.
        world: that it flies in: what it is not as believed, and what else acts.

    Raises:
        ValueError: frameskip is no integer from 0 on, an agent step exceeds the episode, another
            value is not as said, or actions are continuous with torques along no body axis.

    Example:
        >>> import jax
        >>> env = AttitudeEnv(frameskip=20)
        >>> obs, state = env.reset(jax.random.key(0), env.default_params)
        >>> obs.shape
        (11,)
    """

    frameskip: int = 20
    reward: Callable[[Transition], chex.Array] = paper_reward
    initial_state: Callable[[chex.PRNGKey, EnvParams], EnvState] = initial_state.initial_state
    spacecraft: Spacecraft = LM50
    kinematic_factor: float = 0.5
    observes_quaternion_rate: bool = True
    actions: str = "discrete"
    world: World = IDEAL

    def __post_init__(self):
        most = self.spacecraft.most_frameskip
        frameskip = integer(self.frameskip)
        if frameskip is None or not 0 <= frameskip <= most:
            raise ValueError(
                f"frameskip is {self.frameskip!r}; it must be an integer from 0 to {most}"
            )
        object.__setattr__(self, "frameskip", frameskip)  # as JAX compiles for each it is told of
        check_share("kinematic_factor", self.kinematic_factor)
        check_truth("observes_quaternion_rate", self.observes_quaternion_rate)
        check_choice("actions", self.actions, ACTIONS)
        if self._is_continuous:
            torques.largest_torques(np.array(self.spacecraft.torque_table))  # checks the axes

    name = "AttitudeEnv"

    @property
    def _is_continuous(self):
        return self.actions == "continuous"

    @property
    def num_actions(self) -> int:
        """Torques to choose from; the paper's Table 1 has 19.

        Raises:
            AttributeError: actions are continuous.
        """
        if self._is_continuous:
            raise AttributeError("num_actions: there is no number of continuous actions")
        return self.spacecraft.num_actions

    @property
    def control_period(self) -> float:
        """Time between two actions, s."""
        return (1 + self.frameskip) * INTEGRATION_STEP

    @property
    def default_params(self) -> EnvParams:
        """The spacecraft and its task at this frameskip."""
        return parameters.default_params(self.frameskip, self.spacecraft)

    def context(self, params: EnvParams) -> Context:
        """What a controller may know of this environment."""
        agent_step = AgentStep(self.frameskip, params.torque_held, self.kinematic_factor)
        count = 3 if self._is_continuous else len(self.spacecraft.torque_axes)
        told = self.observes_quaternion_rate, self._is_continuous, count
        axes = (
            worlds.torque_axes(params, self.spacecraft, self.actions) if self.world.wheels else None
        )
        return believed(params, self.world, agent_step, axes, told)

    def reset(
        self, key: chex.PRNGKey, params: EnvParams | None = None
    ) -> tuple[chex.Array, EnvState]:
        """Start an episode. Returns the observation (11,) and the state.

        Raises:
            ValueError: a parameter is not as :class:`attjax.EnvParams` says.
        """
        params = self.default_params if params is None else params
        parameters.check_params(params, self.frameskip)
        start = self.initial_state(key, params)
        drawn_once = {x: apart(getattr(start, x)) for x in ("quaternion", "angular_velocity")}
        state = worlds.placed(self, key, start.replace(**drawn_once), params)
        return self.observe(observation_key(key), state, params), state

    reset_env = reset

    def step(
        self,
        key: chex.PRNGKey,
        state: EnvState,
        action: chex.Numeric,
        params: EnvParams | None = None,
    ) -> tuple[chex.Array, EnvState, chex.Array, chex.Array, chex.Array, dict]:
        """One agent step; an episode that ends is followed by a fresh one.

        Args:
            key: of this step, and of the next episode's start.
            state, action, params: as in :func:`attjax.step`.

        Returns:
            Observation (11,), state, reward, terminated, truncated, info. Where the episode
            ended, observation and state are the next episode's, and
            ``info["final_observation"]`` is the ended one's.

        Raises:
            ValueError: as :func:`attjax.step`.
        """
        params = self.default_params if params is None else params
        observation, next_state, reward, terminated, info = self.step_env(
            steps_key(key), state, action, params
        )
        truncated = info["truncated"]
        info["final_observation"] = observation
        observation, next_state = restart_one(
            self.reset_env, (key, params), terminated | truncated, (observation, next_state)
        )
        return observation, next_state, reward, terminated, truncated, info

    def step_env(
        self, key: chex.PRNGKey, state: EnvState, action: chex.Numeric, params: EnvParams
    ) -> tuple[chex.Array, EnvState, chex.Array, chex.Array, dict]:
        """One agent step without reset.

        Returns:
            Observation (11,), state, reward, terminated, info. ``info["score"]`` is the
            reward of Eq. 12–13 whatever the environment's own; ``info["outcome"]`` describes
            the spacecraft after the step and is meant to be read at an episode's end;
            ``info["torque"]``, (3,), N m, body frame, is what acted for the context's
            ``torque_duration``.
        """
        rules = self.frameskip, self.kinematic_factor, self.actions
        next_state = simulator.step(state, action, params, *rules)
        torque = torques.acting_torque(state, action, params, self.frameskip)
        rate = jnp.sqrt(squared_norm(next_state.angular_velocity))
        terminated = rate > params.rate_limit
        truncated = ~terminated & (next_state.time >= params.max_steps_in_episode)
        transition = Transition(
            quaternion=jnp.asarray(state.quaternion),
            next_quaternion=next_state.quaternion,
            next_angular_velocity=next_state.angular_velocity,
            terminated=terminated,
            truncated=truncated,
            goal_angle=params.goal_angle,
            control_period=parameters.control_period(params, self.frameskip),
            impulse=torque * self.context(params).torque_duration,
            torque_table=params.torque_table,
        )
        angle = quaternions.error_angle(next_state.quaternion)
        info = {
            "terminated": terminated,
            "truncated": truncated,
            "score": paper_reward(transition),
            "torque": torque,
            "outcome": {
                "success_rate": (truncated & (angle <= params.goal_angle)).astype(rate.dtype),
                "overspeed_rate": terminated.astype(rate.dtype),
                "terminal_error_deg": jnp.rad2deg(angle),
            },
        }
        observation = self.observe(key, next_state, params)
        return observation, next_state, self.reward(transition), terminated, info

    def observe(self, key: chex.PRNGKey, state: EnvState, params: EnvParams | None) -> chex.Array:
        """What an agent is told of a state: the observation (11,) of Eq. 11, as measured.

        Where there is a disturbance, :func:`attjax.envs.leaning.leaned` against it.

        Args:
            key: unused: what is random of it is of the state.
            state, params: of one spacecraft; without parameters nothing disturbs.
        """
        del key
        rules = self.kinematic_factor, self.observes_quaternion_rate
        told = parameters.measured(state)
        observation = observations.observe(told.quaternion, told.angular_velocity, *rules)
        if params is None or params.disturbance is None:
            return observation
        return leaned(observation, self.context(params))

    def starts_whole(self, state: EnvState) -> chex.Array:
        """Whether the episode that begins with this state is one of the task's: a bool a state.

        The others, practice from the middle of it, count in no metric.
        """
        return initial_state.starts_whole(state)

    def observation_space(self, params: EnvParams) -> spaces.Box:
        """Bounds of Eq. 11 up to the step that exceeds the rate limit.

        Coasting can raise ‖ω‖ at constant energy by at most √(I_max/I_min).
        """
        return spaces.observation_box(params, self.context(params))

    def action_space(self, params: EnvParams | None = None) -> spaces.Discrete | spaces.Box:
        """The rows of the torque table, or fractions of its largest torque about each body axis."""
        table = (self.default_params if params is None else params).torque_table
        if self._is_continuous:
            one = jnp.ones_like(table, shape=3)
            return spaces.Box(-one, one)
        return spaces.Discrete(len(table))
