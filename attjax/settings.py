"""Everything that defines a training run, in one flat frozen dataclass.

This module imports nothing heavy, so that ``--help`` is instant.
"""

import dataclasses
import functools
import math

from attjax import user_functions
from attjax.values import plain

SEED = {"low": 0, "below": 2**32}
FRAMESKIP = {"low": 0, "below": 10_500}
"""Limits of each, as in :func:`setting`."""

MOST_SAMPLES = 2**27
"""Of an update: some 100 GB."""


def setting(help: str, *, unit: str = "", symbol: str = "", group: str = "", **limits):
    """A field without default.

    Args:
        help: what it means, in a line or two.
        unit: of the number, where ``help`` does not say what it counts.
        symbol: the paper's, or the literature's.
        group: of ``GROUPS``.
        limits: ``choices``, or ``low``, ``high`` (inclusive), ``above`` and ``below``
            (exclusive), of each element where the field is a tuple, and ``most`` elements;
            ``or_function``: a user's function will do, as ``module:function``.
    """
    return dataclasses.field(
        metadata={"help": help, "unit": unit, "symbol": symbol, "group": group, **limits}
    )


GROUPS = {
    "run": "run",
    "task": "task",
    "networks": "networks",
    "ppo": "PPO",
    "logging": "logging and debugging",
}
"""Titles of the groups of settings."""

_run, _task, _networks, _ppo, _logging = (functools.partial(setting, group=g) for g in GROUPS)


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

    total_steps: int = _run(
        "agent steps in the whole run, rounded up to whole updates", low=1, high=10**13
    )

    frameskips: tuple[int, ...] = _task(
        "torque-free RK4 steps of 1/240 s after an impulse, k of them for 240/(k + 1) Hz; the "
        "spacecraft are shared out evenly among several values",
        **FRAMESKIP,
        most=64,
    )
    reward: str = _task(
        "Eq. 12-13 with terminal rewards, -log10 of the error angle, or module:function",
        choices=("paper", "logarithmic"),
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

    features: str = _networks(
        "network inputs: Eq. 11 as it is, tanh(k x) of attitude and rate at nine scales, or "
        "module:function",
        choices=("state", "multiscale"),
        or_function=True,
    )
    hidden_sizes: tuple[int, ...] = _networks(
        "neurons of each hidden layer, in the policy as in the value network (Table 3)",
        low=1,
        high=8192,
        most=8,
    )
    rate_margin: float = _networks(
        "mask actions after which coasting would pass this fraction of the rate limit; 0: no mask",
        low=0,
        high=1,
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

    updates_per_block: int = _logging(
        "updates between two looks at the run, each a row of metrics.csv", low=1, high=10**6
    )

    def __post_init__(self):
        for field in dataclasses.fields(self):
            object.__setattr__(self, field.name, check(field, getattr(self, field.name)))
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
    return Settings(**values)


def check(field: dataclasses.Field, value):
    """Return a value that fits the setting, as Python's own: lists and NumPy's numbers will do.

    Raises:
        ValueError: it does not fit; the message names what is allowed.
    """
    value = plain(value)
    is_tuple = field.type == tuple[int, ...]
    kind = int if is_tuple else field.type
    elements = value if is_tuple else (value,)
    fits = isinstance(elements, tuple) and 0 < len(elements) <= field.metadata.get("most", math.inf)
    if not (fits and all(_fits(kind, field.metadata, x) for x in elements)):
        name = {int: "an integer", float: "a number", bool: "true or false"}.get(kind, "")
        allowed = ["integers" if is_tuple else name, limits(field)]
        raise ValueError(f"{field.name} is {value!r}; it must be {' '.join(filter(None, allowed))}")
    return value


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


def limits(field: dataclasses.Field) -> str:
    """What its values may be, beside their type; empty where there is no limit.

    Example:
        >>> limits(Settings.__dataclass_fields__["discount"])
        'above 0 and at most 1'
    """
    given = field.metadata
    if "choices" in given:
        choices = "one of " + ", ".join(given["choices"])
        return choices + (", or module:function" if "or_function" in given else "")
    words = {"low": "at least", "above": "above", "high": "at most", "below": "below"}
    described = " and ".join(f"{word} {given[k]}" for k, word in words.items() if k in given)
    return described + (f", {given['most']} of them at most" if "most" in given else "")
