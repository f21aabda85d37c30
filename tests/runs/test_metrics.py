"""A row of metrics, metrics.csv, and the registry that all that shows metrics is made from."""

import csv
import io
import re

import jax
import jax.numpy as jnp
import pytest
from commands import ROOT
from rich.console import Console
from setups import small_attitude_setup

from attjax import ppo
from attjax.ppo import train_state
from attjax.runs import build, metrics, metrics_file, progress_panel, progress_status
from attjax.runs import folder as run_folder

EPISODE = metrics.Metric(
    name="closest_deg", meaning="a mean over episodes", mean_of="closest_deg",
    tag="episode/closest", is_compared=True,
    cell=metrics.Cell("closest", "{:.1f}°", (0, 3), is_in_line=True),
    curve=metrics.Curve("closest error (°)"),
)  # fmt: skip
LOSS = metrics.Metric(
    name="gradient_norm", meaning="a loss", tag="loss/gradient_norm",
    cell=metrics.Cell("gradient", "{:.2f}", (2, 3)),
)  # fmt: skip


@pytest.fixture
def two_more(monkeypatch):
    """The registry with two more metrics, which nothing else in the package hears of."""
    monkeypatch.setattr(metrics, "METRICS", (*metrics.METRICS, EPISODE, LOSS))


def row_of_two_more():
    names = ("score", "score_squared", "success_rate", "overspeed_rate", "terminal_error_deg")
    block = block_metrics(episodes=[2], closest_deg=[25], **{name: [2] for name in names})
    block["losses"] = {"gradient_norm": jnp.array(0.5)}
    return metrics.block_row(block, (5,), 100, 1.5)


def test_a_metric_of_the_registry_is_a_column(two_more, tmp_path):
    file = metrics_file.MetricsFile(tmp_path, 0)
    file.append(row_of_two_more())
    (row,) = rows_of(tmp_path)
    assert list(row)[-2:] == ["closest_deg", "gradient_norm"]
    assert (row["closest_deg"], row["gradient_norm"]) == ("12.5", "0.5")


def test_a_metric_of_the_registry_is_on_the_panel_and_in_the_lines(two_more):
    status = progress_status.Status(1000, 0)
    status.start(0.0)
    status.add(row_of_two_more(), 1.0)
    console = Console(width=80, record=True, force_terminal=True, file=io.StringIO())
    console.print(progress_panel.Panel(status))
    lines = console.export_text().splitlines()
    assert len(lines) == 5
    assert re.fullmatch(r"closest +12.5° ▁ {26,}gradient +0.50", lines[4])
    line = progress_status.line(status, 1.0)
    assert line.endswith("  closest 12.5°") and "gradient" not in line


def test_every_cell_has_a_place_of_its_own_on_the_panel():
    places = [metric.cell.place for metric in metrics.METRICS if metric.cell]
    assert len(set(places)) == len(places)
    assert max(column for column, _ in places) < len(progress_panel.WIDTHS)


def test_a_metric_of_the_registry_is_a_curve_in_tensorboard(two_more, tmp_path):
    pytest.importorskip("tensorboardX")
    from events import compared, points
    from setups import CONFIG

    from attjax.runs import tensorboard

    tensorboard.EventFile(tmp_path, CONFIG, []).append(row_of_two_more())
    found = points(tmp_path)
    assert found["episode/closest"] == [(100, 12.5)] and found["loss/gradient_norm"] == [(100, 0.5)]
    assert compared(tmp_path)[-1] == "episode/closest"


def test_a_metric_of_the_registry_is_in_the_figure(two_more, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    from attjax import canvas
    from attjax.runs import learning_curve

    figures = []
    monkeypatch.setattr(canvas, "save", lambda figure, *_: figures.append(figure))
    row = {name: str(value) for name, value in row_of_two_more().items()}
    learning_curve.write([row], True, tmp_path)
    assert [axis.get_ylabel() for axis in figures[0].axes] == [
        "return (Eq. 12–13)", "success rate", "terminal error (°)", "closest error (°)"
    ]  # fmt: skip


def test_rows_of_before_a_metric_are_read_and_gone_on_from(tmp_path, monkeypatch):
    metrics_file.MetricsFile(tmp_path, 0).append({"agent_steps": 100, "wall_s": 1.5})
    monkeypatch.setattr(metrics, "METRICS", (*metrics.METRICS, EPISODE, LOSS))
    file = metrics_file.MetricsFile(tmp_path, 100)
    file.append(row_of_two_more())
    assert [row["closest_deg"] for row in rows_of(tmp_path)] == ["", "12.5"]
    assert [row["closest_deg"] for row in file.kept] == [""]


def test_training_makes_the_numbers_of_the_registry_and_no_others():
    setup = small_attitude_setup(1)
    env_params = build.env_params(setup)
    state = train_state.init(setup, env_params, jax.random.key(0))
    _, block = ppo.train_block.eval_shape(setup, env_params, state, 1)
    of_means = {metric.name for metric in metrics.METRICS if metric.mean_of}
    assert {metric.mean_of for metric in metrics.METRICS} - {None} <= set(block["episodes"])
    ready = {"agent_steps", "wall_s", "episodes", "episode_return_std", "episode_return_n"}
    assert set(metrics.columns()) == ready | of_means | set(block["losses"])


def test_the_documentation_has_the_registry():
    text = (ROOT / "docs" / "logs.md").read_text()
    table = text[text.index("| Column |") :].split("\n\n")[0].splitlines()[2:]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table]
    assert rows == [[f"`{m.name}`", m.meaning, m.unit] for m in metrics.METRICS]


def block_metrics(**episodes):
    return {"episodes": {k: jnp.array(v, float) for k, v in episodes.items()}, "losses": {}}


def test_row_pools_rates_and_takes_the_return_of_the_slowest():
    block = block_metrics(
        episodes=[3, 1], score=[900, 50], score_squared=[300_000, 2500],
        success_rate=[3, 0], overspeed_rate=[0, 1], terminal_error_deg=[0.3, 20.1],
    )  # fmt: skip
    row = metrics.block_row(block, (5, 20), 4096, 1.5)
    assert row["episodes"] == 4 and row["episode_return_n"] == 1
    assert row["success_rate"] == 0.75 and row["overspeed_rate"] == 0.25
    assert row["terminal_error_deg"] == pytest.approx(5.1)
    assert row["episode_return"] == 50 and row["episode_return_std"] == 0
    turned = metrics.block_row(block, (20, 5), 4096, 1.5)
    assert turned["episode_return"] == 300 and turned["episode_return_n"] == 3
    both = metrics.block_row(block, (20, 20), 4096, 1.5)
    assert both["episode_return"] == 950 / 4 and both["episode_return_n"] == 4


def test_row_is_empty_where_no_episode_ended():
    zeros = [0, 0]
    row = metrics.block_row(
        block_metrics(
            episodes=zeros, score=zeros, score_squared=zeros,
            success_rate=zeros, overspeed_rate=zeros, terminal_error_deg=zeros,
        ),
        (5, 20), 1, 1.0,
    )  # fmt: skip
    assert row["episodes"] == 0
    assert row["success_rate"] is row["episode_return"] is row["terminal_error_deg"] is None


def rows_of(folder):
    with (folder / run_folder.METRICS).open(newline="") as file:
        return list(csv.DictReader(file))


def test_resuming_drops_the_rows_after_the_checkpoint(tmp_path):
    file = metrics_file.MetricsFile(tmp_path, resume_at=0)
    for steps in (100, 200, 300):
        file.append({"agent_steps": steps, "wall_s": steps / 10, "success_rate": None})
    resumed = metrics_file.MetricsFile(tmp_path, resume_at=200)
    assert resumed.wall_s == 20
    assert [row["agent_steps"] for row in rows_of(tmp_path)] == ["100", "200"]
    resumed.append({"agent_steps": 300, "wall_s": 31.0})
    assert [row["wall_s"] for row in rows_of(tmp_path)] == ["10", "20", "31"]


def test_a_row_that_was_cut_off_is_left_out(tmp_path):
    file = metrics_file.MetricsFile(tmp_path, resume_at=0)
    for steps in (100, 200):
        file.append({"agent_steps": steps, "wall_s": steps / 10})
    path = tmp_path / run_folder.METRICS
    path.write_text(path.read_text() + "20")  # of 200 to 300: would pass for the 20th step
    metrics_file.MetricsFile(tmp_path, resume_at=200)
    assert [row["agent_steps"] for row in rows_of(tmp_path)] == ["100", "200"]


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "\x00\n\x01\n", "agent_steps\n1\n"])
def test_files_that_are_no_metrics_are_refused_and_kept(tmp_path, text):
    path = tmp_path / run_folder.METRICS
    path.write_text(text)
    with pytest.raises(run_folder.FolderError, match=r"metrics\.csv cannot be read"):
        metrics_file.MetricsFile(tmp_path, resume_at=10)
    assert path.read_text() == text
