"""Figures of an evaluation, written as PNG files. Needs the extra ``plot`` (matplotlib)."""

from pathlib import Path

import jax
import numpy as np

from attjax import canvas, evaluation
from attjax.control import time_optimal
from attjax.evaluation import paper
from attjax.evaluation.flight import Flight, angles_deg
from attjax.evaluation.paper import PAPER_TABLE_2

STYLES = ("-", "--", "-.", ":")
RANDOM_SLEWS = 200
FINAL_SECONDS = 8.0


def write_all(flight: Flight, folder: Path) -> list[Path]:
    """Write every figure of a flight into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        *slews(flight, folder),
        final_seconds(flight, folder),
        error_histories(flight, folder),
        distributions(flight, folder),
        settling(flight, folder),
    ]


@canvas.own_style()
def slews(flight: Flight, folder: Path) -> list[Path]:
    """What the paper's Figs. 5–7 show, of Table 5's slews, and the torques chosen."""
    time, history = flight.table_5
    belief, paths = flight.belief(paper.table_5_slews(), history), []
    for index, name in enumerate(paper.TABLE_5):
        one = jax.tree.map(lambda x, index=index: np.asarray(x[:, index]), history)
        figure, axes = canvas.subplots(4, 1, figsize=(7, 9), sharex=True)
        _plot_components(axes[0], time, one.quaternion, ("q1", "q2", "q3", "q_s"))
        _plot_components(axes[2], time, one.angular_velocity, ("ω1", "ω2", "ω3"))
        _plot_pulses(axes[3], time, one.torque, flight.env.spacecraft)
        axes[1].semilogy(time, angles_deg(one.quaternion), "k", linewidth=1)
        if belief is not None:
            _plot_belief(axes[1], belief, index)
        goal = flight.goal_deg
        axes[1].axhline(goal, color="0.5", linestyle=":", label=f"{goal:g}°")
        axes[1].legend(loc="upper right", fontsize=8)
        labels = (
            "error quaternion",
            "error angle φ (°)",
            "angular velocity (rad/s)",
            "torque (N m)",
        )
        for axis, label in zip(axes, labels):
            axis.set_ylabel(label)
        axes[3].set_xlabel("time (s)")
        axes[0].set_title(f"Table 5, test {index + 1}, at {flight.conditions}", parse_math=False)
        paths.append(canvas.save(figure, folder, name))
    return paths


def _plot_belief(axis, belief, index):
    axis.lines[0].set_label("true")
    believed, error = belief.angle_deg[:, index], belief.error_deg[:, index]
    axis.semilogy(belief.time, believed, "--", color="tab:orange", linewidth=1, label="believed")
    axis.semilogy(belief.time, error, color="tab:blue", linewidth=0.8, label="estimation error")


def _plot_components(axis, time, values, names):
    for values_, name, style in zip(values.T, names, STYLES):
        axis.plot(time, values_, style, linewidth=1.2, label=name)
    axis.legend(loc="upper right", ncols=4, fontsize=8)


def _plot_pulses(axis, time, torque, spacecraft):
    levels = sorted(spacecraft.torque_levels)
    for values, name, marker in zip(torque.T, ("M1", "M2", "M3"), "xo+"):
        on = values != 0
        axis.plot(time[on], values[on], marker, markersize=3, label=name)
    axis.set_yscale("symlog", linthresh=0.8 * levels[0])
    pulses = [sign * level for sign in (-1, 1) for level in levels]
    axis.set_yticks([0, *pulses], [f"{pulse:g}" for pulse in (0, *pulses)])
    axis.set_ylim(-3 * levels[-1], 3 * levels[-1])
    axis.legend(loc="upper right", ncols=4, fontsize=8)


@canvas.own_style()
def final_seconds(flight: Flight, folder: Path) -> Path:
    """The end of Table 5's slews, magnified: how a controller holds its target."""
    time, history = flight.table_5
    belief = flight.belief(paper.table_5_slews(), history)
    shown = time > time[-1] - FINAL_SECONDS
    angles = angles_deg(history.quaternion)[shown]
    figure, axis = canvas.subplots(figsize=(7, 4))
    for index, (marker, values) in enumerate(zip("o^s", angles.T)):
        axis.plot(
            time[shown], values, marker + "-", linewidth=1, markersize=3, label=f"test {index + 1}"
        )
    most = angles.max()
    if belief is not None:
        most = max(most, _plot_final_estimates(axis, belief, shown))
    axis.set_ylim(0, 1.2 * most)
    axis.set_xlabel("time (s)")
    axis.set_ylabel("error angle φ (°)")
    title = f"Table 5, the last {FINAL_SECONDS:g} s, at {flight.conditions}"
    axis.set_title(title, parse_math=False)
    axis.legend(loc="upper right", ncols=4, fontsize=8)
    return canvas.save(figure, folder, "final_seconds")


def _plot_final_estimates(axis, belief, shown):
    """Their estimation errors, in the colours of the slews; returns the largest."""
    errors = belief.error_deg[shown]
    for line, values in zip(axis.lines[:], errors.T):
        axis.plot(belief.time[shown], values, ":", color=line.get_color(), linewidth=1.2)
    axis.plot([], [], ":", color="0.3", linewidth=1.2, label="estimation error")
    return errors.max()


@canvas.own_style()
def error_histories(flight: Flight, folder: Path) -> Path:
    """The error angle of random slews over time, with quantiles."""
    start = jax.tree.map(lambda x: x[:RANDOM_SLEWS], flight.starts)
    time, history = flight.record(start)
    angles = angles_deg(history.quaternion)
    figure, axis = canvas.subplots(figsize=(7, 4.5))
    axis.semilogy(time, angles, color="0.8", linewidth=0.3)
    for quantile, style in ((0.95, "--"), (0.5, "-"), (0.05, ":")):
        axis.semilogy(
            time, np.quantile(angles, quantile, axis=1), "k" + style, label=f"{quantile:.0%}"
        )
    belief = flight.belief(start, history)
    if belief is not None:
        median = np.median(belief.error_deg, axis=1)
        axis.semilogy(belief.time, median, color="tab:blue", label="estimation error, 50%")
    goal = flight.goal_deg
    axis.axhline(goal, color="tab:red", linestyle="-.", linewidth=1, label=f"{goal:g}°")
    axis.set_xlabel("time (s)")
    axis.set_ylabel("error angle φ (°)")
    title = f"{angles.shape[1]} random slews at {flight.conditions}, and quantiles"
    axis.set_title(title, parse_math=False)
    axis.legend()
    return canvas.save(figure, folder, "error_histories")


@canvas.own_style()
def distributions(flight: Flight, folder: Path) -> Path:
    """Cumulative distribution of the closest and terminal error.

    The paper's Table 2 stands beside that of its spacecraft, LM50.
    """
    figure, axes = canvas.subplots(1, 2, figsize=(9, 4), sharey=True)
    for axis, state in zip(axes, ("closest", "terminal")):
        ours = np.sort(np.rad2deg(np.asarray(getattr(flight.flown, f"{state}_angle"))))
        axis.semilogx(ours, np.arange(1, len(ours) + 1) / len(ours), "k", label="this controller")
        if flight.is_the_papers:
            paper = PAPER_TABLE_2[state, "error_deg"][2:]
            axis.semilogx(paper, (0, 0.25, 0.5, 0.75, 1), "s--", color="tab:red", label="paper")
        axis.set_xlabel(f"{state} error angle φ (°)")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share of the slews")
    axes[0].legend()
    if not flight.env.world.is_ideal:
        figure.suptitle(f"At {flight.conditions}", parse_math=False)
    return canvas.save(figure, folder, "distributions")


@canvas.own_style()
def settling(flight: Flight, folder: Path) -> Path:
    """Settling time against slew angle, with the time-optimal reference."""
    flown, env, params = flight.flown, flight.env, flight.params
    start = flight.starts.quaternion
    reference = jax.vmap(time_optimal.time_optimal_reference, (0, None))
    optimal = np.asarray(reference(start, env.context(params)))
    angles = angles_deg(start)
    settled = evaluation.successes(flown, params)
    times = evaluation.settling_times(flown, env)
    figure, axis = canvas.subplots(figsize=(7, 4.5))
    axis.plot(angles[settled], times[settled], ".", color="0.6", markersize=2, label="slews")
    edges = np.linspace(angles.min(), angles.max(), 13)
    middle = (edges[:-1] + edges[1:]) / 2
    bins = np.digitize(angles, edges[1:-1])
    for values, chosen, style, label in (
        (times, settled, "k-", "their mean"),
        (optimal, np.ones_like(settled), "k--", "time-optimal reference, mean"),
    ):
        binned = [values[chosen & (bins == b)] for b in range(12)]
        means = [np.mean(x) if len(x) else np.nan for x in binned]
        axis.plot(middle, means, style, label=label)
    axis.set_xlabel("slew angle (°)")
    axis.set_ylabel(f"settling time to {flight.goal_deg:g}° (s)")
    axis.set_title(f"Settling at {flight.conditions}", parse_math=False)
    axis.legend()
    return canvas.save(figure, folder, "settling")
