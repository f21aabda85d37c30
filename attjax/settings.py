"""Everything that defines a training run, in one flat frozen dataclass.

This module imports nothing heavy, so that ``--help`` is instant.
"""

import dataclasses
import math

from attjax import user_functions

MOST_SAMPLES = 2**27
"""Of an update: some 100 GB."""


def setting(help: str, **limits):
    """A field without default. ``limits``: ``choices``, or ``low``, ``high`` (inclusive),
    ``above`` and ``below`` (exclusive), of each element where the field is a tuple, and ``most``
    elements. ``or_function``: a user's function will do, as ``module:function``.
    """
    return dataclasses.field(metadata={"help": help, **limits})


def single(name: str, kind: type, help: str, **limits) -> dataclasses.Field:
    """A field, as of :func:`setting`, that belongs to no class: for :func:`check`."""
    field = setting(help, **limits)
    field.name, field.type = name, kind
    return field


@dataclasses.dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a training run; ``presets.py`` gives the values.

    Raises:
        ValueError: a value is out of its range, or two values do not fit together.
    """

    # The task
    frameskips: tuple[int, ...] = setting(
        "torque-free RK4 steps after an impulse; the environments are shared out evenly "
        "among several values",
        low=0,
        below=10_500,
        most=64,
    )
    reward: str = setting(
        "Eq. 12-13 with terminal rewards, -log10 of the error angle, or module:function",
        choices=("paper", "logarithmic"),
        or_function=True,
    )
    reward_scale: float = setting("factor on the reward the learner sees", above=0)
    time_limit_terminates: bool = setting(
        "learn the time limit as an end, as the paper did; otherwise bootstrap there"
    )
    max_episode_steps: int = setting(
        "cap on an episode's agent steps in training, beside its 43.75 s", low=1, high=10_500
    )
    near_goal_share: float = setting(
        "share of the training episodes that start near the goal, at any scale, and are short",
        low=0,
        below=1,
    )
    near_goal_steps: int = setting("agent steps of such an episode", low=1, high=10_500)
    stagger_episodes: bool = setting(
        "start the first episodes at random times, so that they do not end all at once"
    )

    # The networks
    features: str = setting(
        "network inputs: Eq. 11 as it is, tanh(k x) of attitude and rate at nine scales, or "
        "module:function",
        choices=("state", "multiscale"),
        or_function=True,
    )
    hidden_sizes: tuple[int, ...] = setting(
        "neurons of each hidden layer (Table 3)", low=1, high=8192, most=8
    )
    rate_margin: float = setting(
        "mask actions after which coasting would pass this fraction of the rate limit; 0: no mask",
        low=0,
        high=1,
    )

    # PPO
    total_steps: int = setting(
        "agent steps in the whole run, rounded up to whole updates", low=1, high=10**13
    )
    num_envs: int = setting("spacecraft simulated side by side", low=1, high=2**22)
    greedy_share: float = setting(
        "share of the spacecraft that act greedily, as in flight, while the others explore",
        low=0,
        below=1,
    )
    rollout_length: int = setting(
        "agent steps of each spacecraft between two updates", low=1, high=2**16
    )
    passes: int = setting("passes over the data of an update (N)", low=1, high=1000)
    minibatch_size: int = setting("samples in a gradient step", low=1)
    discount: float = setting("discount (gamma)", above=0, high=1)
    discount_period: float = setting(
        "time over which the discount applies, s; 0: an agent step, however long", low=0
    )
    gae_lambda: float = setting("GAE's lambda; 1 is Eq. 5", low=0, high=1)
    clip: float = setting("clipping parameter (epsilon, Eq. 4)", above=0, below=1)
    entropy_coefficient: float = setting("weight of the entropy bonus (c) at the start", low=0)
    final_entropy_coefficient: float = setting("and at the end; linear in between", low=0)
    learning_rate: float = setting("Adam's learning rate at the start", above=0)
    final_learning_rate: float = setting("and at the end; linear in between", low=0)
    normalize_advantage: bool = setting("standardise the advantages of each minibatch")
    max_gradient_norm: float = setting("clip each network's gradient norm; 0: do not", low=0)
    updates_per_block: int = setting(
        "updates between two progress lines, each a row of metrics.csv", low=1, high=10**6
    )

    def __post_init__(self):
        for field in dataclasses.fields(self):
            check(field, getattr(self, field.name))
        if self.num_envs < len(self.frameskips):
            raise ValueError(
                f"num_envs is {self.num_envs}; it must be at least {len(self.frameskips)}, "
                f"the number of frameskips"
            )
        if self.minibatch_size > self.steps_per_update:
            raise ValueError(
                f"minibatch_size is {self.minibatch_size}; it must be at most "
                f"num_envs x rollout_length = {self.steps_per_update}"
            )
        if self.steps_per_update > MOST_SAMPLES:
            raise ValueError(
                f"num_envs x rollout_length is {self.steps_per_update}; "
                f"it must be at most {MOST_SAMPLES}"
            )
        if self.num_updates * self.passes * self.minibatches >= 2**31:
            raise ValueError(
                f"total_steps is {self.total_steps}; with these passes and minibatches that makes "
                f"{self.num_updates * self.passes * self.minibatches} gradient steps, and they "
                f"must be fewer than 2^31"
            )

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
        return self.steps_per_update // self.minibatch_size


def from_json(values: dict) -> Settings:
    """Settings from what ``json.loads`` makes of ``dataclasses.asdict(settings)``.

    Raises:
        ValueError: a name is unknown or missing, or a value is out of range.
    """
    names = {field.name for field in dataclasses.fields(Settings)}
    if set(values) != names:
        wrong = sorted(set(values) ^ names)
        raise ValueError(f"settings are unknown or missing: {', '.join(wrong)}")
    return Settings(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})


def check(field: dataclasses.Field, value) -> None:
    """Raise ValueError, naming what is allowed, unless ``value`` fits the setting."""
    is_tuple = field.type == tuple[int, ...]
    kind = int if is_tuple else field.type
    elements = value if is_tuple else (value,)
    fits = isinstance(elements, tuple) and 0 < len(elements) <= field.metadata.get("most", math.inf)
    if not (fits and all(_fits(kind, field.metadata, x) for x in elements)):
        name = {int: "an integer", float: "a number", bool: "true or false"}.get(kind, "")
        allowed = ["integers" if is_tuple else name, _describe(field.metadata)]
        raise ValueError(f"{field.name} is {value!r}; it must be {' '.join(filter(None, allowed))}")


def _fits(kind, limits, x):
    if type(x) is not kind and not (kind is float and type(x) is int):
        return False
    if kind not in (int, float):
        is_function = limits.get("or_function", False) and user_functions.is_name(x)
        return is_function or x in limits.get("choices", (x,))
    return (
        math.isfinite(x)
        and limits.get("low", x) <= x <= limits.get("high", x)
        and limits.get("above", -math.inf) < x < limits.get("below", math.inf)
    )


def _describe(limits):
    if "choices" in limits:
        choices = "one of " + ", ".join(limits["choices"])
        return choices + (", or module:function" if "or_function" in limits else "")
    words = {"low": "at least", "above": "above", "high": "at most", "below": "below"}
    described = " and ".join(f"{word} {limits[k]}" for k, word in words.items() if k in limits)
    return described + (f", {limits['most']} of them at most" if "most" in limits else "")
