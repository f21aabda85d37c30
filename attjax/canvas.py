"""Matplotlib's figures, to be written as PNG files: the same whatever its user has set up.

No pyplot: it would need the user's backend, of a notebook for one, and keep figures for windows.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure


@contextlib.contextmanager
def own_style() -> Iterator[None]:
    """Matplotlib's defaults, whatever a matplotlibrc says, while a figure is made; a decorator."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        yield


def subplots(
    rows: int = 1, columns: int = 1, *, figsize: tuple[float, float], **options: Any
) -> tuple[Figure, Any]:
    """A figure of that size in inches and its axes, as of ``Figure.subplots``."""
    figure = Figure(figsize=figsize, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def save(figure: Figure, folder: Path, name: str) -> Path:
    """Write a figure into a folder; returns its path."""
    path = folder / f"{name}.png"
    figure.savefig(path, dpi=150)
    return path
