"""The settings of a training run, subject by subject: what each means and may be.

This module imports nothing heavy, so that ``--help`` is instant.
"""

import dataclasses
import functools

from attjax.config.fields import FRAMESKIP, GROUPS, Checked, setting
from attjax.values import ACTIONS

_run, _task, _networks, _ppo, _logging = (functools.partial(setting, group=g) for g in GROUPS)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Task(Checked):
    """What is flown in training, and what the learner is told of it."""

    frameskips: tuple[int, ...] = _task(
        "torque-free RK4 steps of 1/240 s after an impulse, k of them for 240/(k + 1) Hz; the "
        "spacecraft are shared out evenly among several values",
        **FRAMESKIP,
        most=64,
    )
    reward: str = _task(
        "Eq. 12-13 with terminal rewards, -log10 of the error angle, Eq. 12-13 without the "
        "exponential, as in the authors' public code without and with a price on torque, or "
        "module:function",
        choices=("paper", "logarithmic", "way", "binary", "authors", "authors-continuous"),
        or_function=True,
    )
    reward_scale: float = _task("factor on the reward the learner sees", above=0)
    time_limit_terminates: bool = _task(
        "learn the time limit as an end, as the paper did; otherwise bootstrap there"
    )
    max_episode_steps: int = _task(
        "cap on an episode's agent steps in training, beside its duration",
        symbol="T",
        low=1,
        high=10_500,
    )
    near_goal_share: float = _task(
        "share of the training episodes that start near the goal, at any scale, and are short",
        low=0,
        below=1,
    )
    near_goal_steps: int = _task("agent steps of such a short episode", low=1, high=10_500)
    stagger_episodes: bool = _task(
        "start the first episodes at random times, so that they do not end all at once"
    )
    any_spacecraft: bool = _task(
        "train on spacecraft of every kind, drawn anew every 32 updates, not on the run's own",
        before=False,
    )
    crippled_share: float = _task(
        "share of these spacecraft with the torques about one axis dead",
        low=0,
        high=1,
        before=0.0,
    )
    in_flight_loop: bool = _task(
        "learn on what a flight loop's estimator believes, as it will fly; otherwise on what is "
        "measured. In the ideal world they are the same",
        before=False,
    )
    kinematic_factor: float = _task(
        "factor of Eq. 9, 0.5; 1 in the authors' public code, where attitude turns twice as fast",
        above=0,
        high=1,
        before=0.5,
    )
    actions: str = _task(
        "choose one of the torques, or any about the three axes at once up to the largest",
        choices=ACTIONS,
        before="discrete",
    )
    observes_quaternion_rate: bool = _task(
        "observe Eq. 11's rate of the quaternion; otherwise zeros, as in the authors' public code",
        before=True,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Network(Checked):
    """What the networks see, their size, and the mask of their actions."""

    features: str = _networks(
        "network inputs: Eq. 11 as it is, tanh(k x) of attitude and rate at nine scales, the same "
        "in the spacecraft's own units, or module:function",
        choices=("state", "multiscale", "universal"),
        or_function=True,
    )
    hidden_sizes: tuple[int, ...] = _networks(
        "neurons of each hidden layer, in the policy as in the value network (Table 3)",
        low=1,
        high=8192,
        most=8,
    )
    initial_weights: str = _networks(
        "orthogonal with small first decisions, or uniform up to 1/sqrt(inputs) as PyTorch's are",
        choices=("orthogonal", "uniform"),
        before="orthogonal",
    )
    rate_margin: float = _networks(
        "mask actions after which coasting would pass this fraction of the rate limit; where they "
        "are continuous, end training episodes there; 0: neither",
        low=0,
        high=1,
    )

    @property
    def is_universal(self) -> bool:
        """Whether they are for any spacecraft with three torque axes."""
        return self.features == "universal"


@dataclasses.dataclass(frozen=True, kw_only=True)
class PPO(Checked):
    """How it is learned."""

    total_steps: int = _run(
        "agent steps in the whole run, rounded up to whole updates", low=1, high=10**13
    )
    num_envs: int = _ppo(
        "spacecraft simulated side by side (the paper's 30 episodes an epoch, Table 4)",
        symbol="M",
        low=1,
        high=2**22,
    )
    greedy_share: float = _ppo(
        "share of the spacecraft that act greedily, as in flight, while the others explore",
        low=0,
        below=1,
    )
    rollout_length: int = _ppo(
        "agent steps of each spacecraft between two updates", low=1, high=2**16
    )
    passes: int = _ppo("passes over the data of an update", symbol="N", low=1, high=1000)
    minibatch_size: int = _ppo("samples in a gradient step (batch size in Table 4)", low=1)
    most_minibatches: int = _ppo(
        "gradient steps in a pass at most; 0: as many as the samples give", low=0, before=0
    )
    discount: float = _ppo("discount of later rewards (Eq. 2)", symbol="γ", above=0, high=1)
    discount_period: float = _ppo(
        "time that the discount applies to; 0: an agent step, however long", unit="s", low=0
    )
    gae_lambda: float = _ppo(
        "share of later steps in the advantage (GAE); 1 is Eq. 5", symbol="λ", low=0, high=1
    )
    clip: float = _ppo("clipping parameter (Eq. 4)", symbol="ε", above=0, below=1)
    entropy_coefficient: float = _ppo("weight of the entropy bonus at the start", symbol="c", low=0)
    final_entropy_coefficient: float = _ppo("and at the end; linear in between", symbol="c", low=0)
    learning_rate: float = _ppo("Adam's learning rate at the start (Table 4)", above=0)
    final_learning_rate: float = _ppo("and at the end; linear in between", low=0)
    normalize_advantage: bool = _ppo("standardise the advantages (Eq. 5) of each minibatch")
    max_gradient_norm: float = _ppo("clip each network's gradient norm; 0: do not", low=0)

    @property
    def steps_per_update(self) -> int:
        """Agent steps that one update learns from."""
        return self.num_envs * self.rollout_length

    @property
    def num_updates(self) -> int:
        """Updates in the whole run."""
        return -(-self.total_steps // self.steps_per_update)

    @property
    def minibatches(self) -> int:
        """Gradient steps in a pass; samples beyond whole minibatches sit that pass out."""
        given = self.steps_per_update // self.minibatch_size
        return min(given, self.most_minibatches or given)

    @property
    def gradient_steps(self) -> int:
        """In the whole run."""
        return self.num_updates * self.passes * self.minibatches


@dataclasses.dataclass(frozen=True, kw_only=True)
class Logging(Checked):
    """What is told of the run while it goes on."""

    updates_per_block: int = _logging(
        "updates between two looks at the run, each a row of metrics.csv", low=1, high=10**6
    )
