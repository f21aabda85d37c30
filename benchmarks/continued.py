"""How many agent steps a policy takes to fly another spacecraft: trained anew, or continued.

After each update the greedy policy flies slews at 40 Hz. It has adapted in the first update from
which on all slews end at the goal with a mean terminal error of at most 1.2 times the last one's.

Example:
    python benchmarks/continued.py docs/examples/lm50-doubled.toml --from pretrained/precise
"""

import argparse
from pathlib import Path

from attjax import errors, train
from attjax.evaluation import evaluate
from attjax.runs.trainer import Observer
from attjax.spacecraft import Spacecraft

NEAR = 1.2


class Judge(Observer):
    """Evaluates the policy of a run at its start and after each block."""

    def __init__(self, episodes):
        self._episodes = episodes
        self.points = []

    def started(self, run, _):
        """Judge what it begins with."""
        self._run = run
        self._judge()

    def block(self, _):
        """Judge what it has become."""
        self._judge()

    def _judge(self):
        result = evaluate(self._run.policy, self._run.env, episodes=self._episodes)
        error = result["terminal"]["error_deg"]["mean"]
        self.points.append((self._run.agent_steps, result["success_rate"], error))
        print("{:>10,} agent steps: {:7.2%} success, {:.6f}°".format(*self.points[-1]), flush=True)


@errors.program("continued.py")
def main(argv=None) -> int:
    """Train, and print the course and when it had adapted."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("spacecraft", type=Path, metavar="FILE", help="TOML file")
    parser.add_argument("--from", metavar="FOLDER", dest="origin", help="begin with its networks")
    parser.add_argument("--total-steps", type=int, default=2_000_000)
    parser.add_argument("--seed", type=int, default=0, help="of the training")
    parser.add_argument("--episodes", type=int, default=500, help="slews of an evaluation")
    arguments = parser.parse_args(argv)
    judge = Judge(arguments.episodes)
    train(
        "precise",
        resume_from=arguments.origin,
        spacecraft=Spacecraft.from_toml(arguments.spacecraft),
        seed=arguments.seed,
        total_steps=arguments.total_steps,
        updates_per_block=1,
        callback=judge,
    )
    print(f"adapted after: {adapted(judge.points)}")
    return 0


def adapted(points):
    """Agent steps from which on the policy was as good as at the end; "never" if not there."""
    last, found = points[-1][2], "never"
    for steps, success, error in reversed(points):
        if success < 1 or error > NEAR * last:
            break
        found = f"{steps:,} agent steps"
    return found


if __name__ == "__main__":
    raise SystemExit(main())
