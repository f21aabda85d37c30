"""Judging controllers: episodes, statistics, the paper's tables, figures, playback."""

from attjax.evaluation.episodes import Controller, Episodes, History, fly, random_slews, record
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
    "conditions",
    "evaluate",
    "fly",
    "random_slews",
    "record",
    "settling_times",
    "statistics",
    "successes",
    "summarize",
]
