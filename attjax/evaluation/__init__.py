"""Judging controllers: episodes, statistics, the paper's tables, figures, playback."""

from attjax.evaluation.blocks import Episodes, Holding
from attjax.evaluation.episodes import fly, random_slews
from attjax.evaluation.fleets import evaluate_fleet
from attjax.evaluation.flown import Controller
from attjax.evaluation.history import History, record
from attjax.evaluation.summary import (
    STATISTICS,
    conditions,
    evaluate,
    settling_times,
    statistics,
    successes,
    summarize,
)

__all__ = [
    "STATISTICS",
    "Controller",
    "Episodes",
    "History",
    "Holding",
    "conditions",
    "evaluate",
    "evaluate_fleet",
    "fly",
    "random_slews",
    "record",
    "settling_times",
    "statistics",
    "successes",
    "summarize",
]
