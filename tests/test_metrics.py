import csv

import jax.numpy as jnp
import pytest

from attjax import metrics, run_folder


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
    file = metrics.MetricsFile(tmp_path, resume_at=0)
    for steps in (100, 200, 300):
        file.append({"agent_steps": steps, "wall_s": steps / 10, "success_rate": None})
    resumed = metrics.MetricsFile(tmp_path, resume_at=200)
    assert resumed.wall_s == 20
    assert [row["agent_steps"] for row in rows_of(tmp_path)] == ["100", "200"]
    resumed.append({"agent_steps": 300, "wall_s": 31.0})
    assert [row["wall_s"] for row in rows_of(tmp_path)] == ["10", "20", "31"]


def test_a_row_that_was_cut_off_is_left_out(tmp_path):
    file = metrics.MetricsFile(tmp_path, resume_at=0)
    for steps in (100, 200):
        file.append({"agent_steps": steps, "wall_s": steps / 10})
    path = tmp_path / run_folder.METRICS
    path.write_text(path.read_text() + "20")  # of 200 to 300: would pass for the 20th step
    metrics.MetricsFile(tmp_path, resume_at=200)
    assert [row["agent_steps"] for row in rows_of(tmp_path)] == ["100", "200"]


@pytest.mark.parametrize("text", ["a,b\n1,2\n", "\x00\n\x01\n", "agent_steps\n1\n"])
def test_files_that_are_no_metrics_are_refused_and_kept(tmp_path, text):
    path = tmp_path / run_folder.METRICS
    path.write_text(text)
    with pytest.raises(run_folder.FolderError, match=r"metrics\.csv cannot be read"):
        metrics.MetricsFile(tmp_path, resume_at=10)
    assert path.read_text() == text
