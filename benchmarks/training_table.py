"""The table of training.py: each contender at its best minibatch size."""

import common

COLUMNS = [
    "", "passes", "mini-\nbatch", "compile\n(s)", "agent-\nsteps/s", "\nrange", "\nCPU",
    "of\nceiling", "attjax\n/ it",
]  # fmt: skip
CEILING = "ceiling"


def best_of_each(results: list[dict]) -> dict[tuple[str, int], dict]:
    """By name and passes, the result with the highest median."""
    best = {}
    for result in results:
        key = result["name"], result.get("passes")
        if key not in best or median(result) > median(best[key]):
            best[key] = result
    return best


def median(result):
    """Agent-steps/s; 0 where nothing was measured."""
    return result.get("steps_per_s", {"median": 0})["median"]


def print_table(results: list[dict], cores: int) -> None:
    """Each contender at its best minibatch size, beside the ceiling at its best and attjax."""
    best, rows, notes = best_of_each(results), [], []
    for (name, passes), result in sorted(best.items(), key=lambda item: item[0][1] or 0):
        if "failure" in result:
            rows.append([name, *["–"] * (len(COLUMNS) - 1)])
            notes.append(f"{name}: {result['failure']}")
            continue
        steps_per_s = result["steps_per_s"]
        rows.append(
            [
                name,
                str(passes),
                str(result["minibatch_size"]),
                f"{result['compile_s']:.1f}",
                common.rate(median(result)),
                f"{common.rate(steps_per_s['low'])}–{common.rate(steps_per_s['high'])}",
                f"{sum(result['cpu_s']) / sum(result['update_s']):.2f}",
                f"{median(result) / median(best[CEILING, passes]):.2f}",
                f"{median(best['attjax', passes]) / median(result):.2f}",
            ]
        )
    notes.append(
        f"{cores} core{'s' * (cores > 1)}; range: lowest and highest repeat; CPU: processor time "
        f"over wall time, {cores} if all are busy and undisturbed"
    )
    common.print_table(COLUMNS, rows, notes)
