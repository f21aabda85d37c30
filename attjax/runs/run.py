"""A training run in memory: its learner, and blocks of updates."""

import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from attjax import ppo
from attjax.config.fields import frameskip_to_judge
from attjax.config.run import Config
from attjax.envs.attitude import AttitudeEnv
from attjax.ppo import train_state
from attjax.ppo.train_state import Learner, Setup
from attjax.runs import build, metrics, metrics_file
from attjax.runs import debug_nans as nan_check

HELD = 8
"""Updates in which only the value network learns, where a policy is continued without its own.

What a new one says of a trained policy's actions is noise at first: without them a policy with
89 % success had 62 % after four updates (docs/train.md).
"""


class Diverged(Exception):
    """Training met a number that is not finite; the message says where, and in which update."""


class Run:
    """A training run, at its start or wherever it has come to.

    Attributes:
        config: what it was started with.
        setup: environment and networks, made of it.
        env_params: of the spacecraft that it trains on.
        learner: all that changes.
        update: updates done.
        rows: of metrics, as text, the cells of metrics.csv.
        wall_s: how long it has trained, s.
    """

    def __init__(self, config: Config, setup: Setup, networks: dict | None = None):
        """At its start, with parameters of networks of another run in place of random ones."""
        self.config, self.setup = config, setup
        self.env_params = build.env_params(setup, config.seed)
        self.learner = train_state.init(setup, self.env_params, jax.random.key(config.seed))
        if networks:
            drawn = self.learner.params
            placed = {
                name: jax.device_put(network, jax.tree.map(lambda x: x.sharding, drawn[name]))
                for name, network in networks.items()
            }
            self.learner = self.learner.replace(params=drawn | placed)
        self.update, self.wall_s = 0, 0.0
        self.rows: list[dict] = []
        self._clock: float | None = None

    def go_on_from(self, learner: Learner, rows: list[dict], wall_s: float) -> None:
        """Take a saved learner for the one that it has; its rows of metrics, and its clock."""
        self.learner, self.update = learner, int(learner.update)
        self.env_params = build.env_params(self.setup, self.config.seed, self.update)
        self.rows, self.wall_s = list(rows), wall_s

    @property
    def agent_steps(self) -> int:
        """Agent steps done."""
        return self.update * self.config.settings.ppo.steps_per_update

    @property
    def total_steps(self) -> int:
        """Agent steps of the whole run: those asked for, rounded up to whole updates."""
        ppo = self.config.settings.ppo
        return ppo.num_updates * ppo.steps_per_update

    @property
    def is_complete(self) -> bool:
        """Whether all its updates are done."""
        return self.update >= self.config.settings.ppo.num_updates

    @property
    def terminal_error(self) -> float | None:
        """Of the episodes that ended last, degrees; None if none did."""
        cell = self.rows[-1]["terminal_error_deg"] if self.rows else None
        return float(cell) if cell else None

    @property
    def policy(self) -> jax.tree_util.Partial:
        """The policy as it is now: ``act(observation, context) -> action``, greedy."""
        return jax.tree_util.Partial(
            self.setup.policy.act, {"policy": self.learner.params["policy"]}
        )

    @property
    def env(self) -> AttitudeEnv:
        """The spacecraft's task as it is judged: at 40 Hz, or the trained rate nearest to it."""
        frameskip = frameskip_to_judge(self.config.settings.task.frameskips)
        rules = build.rules(self.config.settings.task)
        config = self.config
        return AttitudeEnv(frameskip, spacecraft=config.spacecraft, world=config.world, **rules)

    @property
    def metrics(self) -> dict[str, np.ndarray]:
        """The columns of metrics.csv, a row each block of updates; NaN where a cell is empty."""
        return metrics_file.arrays(self.rows)

    def compiled(self, debug_nans: bool = False) -> Callable:
        """The compiled program of a block of updates; if asked, with a check of every operation."""
        arguments = self.setup, self.env_params, self.learner
        if debug_nans:
            return nan_check.train_block(*arguments)
        return ppo.train_block.lower(*arguments, 1).compile()

    def train_block(self, train_block: Callable) -> dict:
        """Run the next block of updates; returns its row of metrics.

        Args:
            train_block: of :meth:`compiled`.

        Raises:
            Diverged: something was not finite. The learner is lost.
        """
        settings = self.config.settings
        if self._clock is None:
            self._clock = time.monotonic() - self.wall_s
        count = settings.logging.updates_per_block
        count = min(count, settings.ppo.num_updates - self.update)
        if settings.task.any_spacecraft:
            count = min(count, build.FLEET_UPDATES - self.update % build.FLEET_UPDATES)
            self._renew_fleet()
        held = None
        if self._holds_policy:
            count = 1
            held = jax.tree.map(jnp.copy, self.learner.params["policy"])
        try:
            self.learner, block = train_block(self.env_params, self.learner, count)
        except nan_check.NotFinite as found:
            raise self._diverged(self.update, count, str(found)) from None
        diverged = {name: int(update) for name, update in block["diverged"].items()}
        if max(diverged.values()) >= 0:
            first = min(update for update in diverged.values() if update >= 0)
            names = ", ".join(name for name, update in diverged.items() if update == first)
            raise self._diverged(first, 1, names)
        if held is not None:
            self.learner = self.learner.replace(params=self.learner.params | {"policy": held})
        self.update += count
        self.wall_s = time.monotonic() - self._clock
        row = metrics.block_row(block, settings.task.frameskips, self.agent_steps, self.wall_s)
        self.rows.append(metrics_file.cells(row))
        return row

    @property
    def _holds_policy(self):
        """Whether the value network, which began anew, is not yet to be listened to."""
        origin = self.config.resumed_from
        return origin is not None and not origin.has_value and self.update < HELD

    def _renew_fleet(self):
        """Other spacecraft, at the start of an episode, where their update has come."""
        if self.update == 0 or self.update % build.FLEET_UPDATES:
            return
        seed = self.config.seed
        self.env_params = build.env_params(self.setup, seed, self.update)
        key = jax.random.fold_in(jax.random.key(seed), self.update)
        self.learner = train_state.restarted(self.setup, self.env_params, self.learner, key)

    def _diverged(self, update, count, what):
        """One line that says in which of the updates what was not finite."""
        steps = (update + count) * self.config.settings.ppo.steps_per_update
        updates = f"update {update}" if count == 1 else f"updates {update} to {update + count - 1}"
        return Diverged(f"not finite at agent step {steps:,} ({updates}): {what}")
