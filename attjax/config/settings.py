"""Everything that defines a training run, by subject, composed into one frozen dataclass.

Names are unique over the subjects, so that flags, TOML files and keyword arguments need no more
than a name. This module imports nothing heavy, so that ``--help`` is instant.
"""

import dataclasses
from typing import Any

from attjax.config.fields import GROUPS
from attjax.config.subjects import PPO, Logging, Network, Task

MOST_SAMPLES = 2**27
"""Of an update: some 100 GB."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a training run, by subject; ``presets.py`` gives the values.

    Raises:
        ValueError: a value is out of its range, or two values do not fit together.

    Example:
        >>> from attjax.config.presets import PAPER
        >>> wide = PAPER.replace(hidden_sizes=(512, 512), num_envs=64)
        >>> wide.network.hidden_sizes, wide.ppo.num_envs
        ((512, 512), 64)
    """

    task: Task
    network: Network
    ppo: PPO
    logging: Logging

    def __post_init__(self):
        if self.ppo.num_envs < len(self.task.frameskips):
            raise ValueError(
                f"num_envs is {self.ppo.num_envs}; it must be at least "
                f"{len(self.task.frameskips)}, the number of frameskips"
            )
        self._check_sizes()

    def _check_sizes(self):
        ppo = self.ppo
        if ppo.minibatch_size > ppo.steps_per_update:
            raise ValueError(
                f"minibatch_size is {ppo.minibatch_size}; it must be at most "
                f"num_envs x rollout_length = {ppo.steps_per_update}"
            )
        if ppo.steps_per_update > MOST_SAMPLES:
            raise ValueError(
                f"num_envs x rollout_length is {ppo.steps_per_update}; "
                f"it must be at most {MOST_SAMPLES}"
            )
        if ppo.gradient_steps >= 2**31:
            raise ValueError(
                f"total_steps is {ppo.total_steps}; with these passes and minibatches that makes "
                f"{ppo.gradient_steps} gradient steps, and they must be fewer than 2^31"
            )

    @property
    def flat(self) -> dict:
        """All values by name."""
        return {name: getattr(getattr(self, SUBJECT_OF[name]), name) for name in FIELDS}

    def replace(self, **values: Any) -> "Settings":
        """The same but for values given by their names, whatever their subjects.

        Raises:
            ValueError: as the class, or a name is unknown.
        """
        return from_flat(self.flat | values)


SUBJECTS: dict[str, Any] = {field.name: field.type for field in dataclasses.fields(Settings)}
"""The classes that settings are composed of, by the names of their subjects."""

SUBJECT_OF = {
    field.name: name for name, subject in SUBJECTS.items() for field in dataclasses.fields(subject)
}
"""The subject of each setting."""

FIELDS = {
    field.name: field
    for group in GROUPS
    for subject in SUBJECTS.values()
    for field in dataclasses.fields(subject)
    if field.metadata["group"] == group
}
"""What describes each setting, group by group."""


def from_json(values: dict) -> Settings:
    """Settings from what ``json.loads`` makes of ``dataclasses.asdict(settings)``.

    Raises:
        ValueError: a name is unknown or missing, or a value is out of range.
    """
    if not (isinstance(values, dict) and all(isinstance(x, dict) for x in values.values())):
        raise ValueError(f"settings are {values!r:.40}; they must be {', '.join(SUBJECTS)}")
    return from_flat({k: x for subject in values.values() for k, x in subject.items()})


def from_flat(values: dict) -> Settings:
    """Settings from all values by name, as of :attr:`Settings.flat`, or JSON of it.

    Raises:
        ValueError: a name is unknown or missing, or a value is out of range.
    """
    if set(values) != set(FIELDS):
        wrong = sorted(set(values) ^ set(FIELDS))
        raise ValueError(f"settings are unknown or missing: {', '.join(wrong)}")
    of_subject = {
        name: {field.name: values[field.name] for field in dataclasses.fields(subject)}
        for name, subject in SUBJECTS.items()
    }
    return Settings(**{name: SUBJECTS[name](**x) for name, x in of_subject.items()})
