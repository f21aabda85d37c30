"""What an evaluation shows, and the files that it writes: tried before the work, written after."""

import contextlib
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, TextIO

from attjax import destinations, errors
from attjax.runs import folder as run_folder


def prepare_plots(folder: Path | None) -> ModuleType | None:
    """The module that draws, with its folder made; None where no plots were asked for.

    Raises:
        UserError: matplotlib cannot be imported, or the folder cannot be written.
    """
    if folder is None:
        return None
    os.environ["MPLBACKEND"] = "agg"  # one of a notebook or of another matplotlib fails its import
    try:
        from attjax.evaluation import plots
    except ImportError:
        raise errors.UserError("--plot needs matplotlib: pip install 'attjax[plot]'") from None
    except ValueError as error:
        raise errors.UserError(
            f"--plot: matplotlib cannot read its matplotlibrc: {error}"
        ) from None
    destinations.check_folder("--plot", folder)
    return plots


def prepare_playback(path: Path | None, steps: int) -> None:
    """See that a page of so many agent steps can be made, and written.

    Raises:
        UserError: it cannot.
    """
    if path is None:
        return
    from attjax.evaluation.playback import page

    if steps > page.MAX_STEPS:
        raise errors.UserError(
            f"--playback shows slews of at most {page.MAX_STEPS:,} agent steps, and these "
            f"have {steps:,}: give a shorter --duration or a larger --frameskip"
        )
    if os.path.exists(path) and not os.path.isfile(path):
        raise errors.UserError(f"--playback {path} cannot be written: it is no ordinary file")
    destinations.check("--playback", path)


@contextlib.contextmanager
def flying(name: str, slews: int | None) -> Iterator[Callable[..., None]]:
    """Show on a terminal how many slews have flown, and when the others will have.

    Args:
        name: of what flies.
        slews: how many; None: it is told with how many have.

    Yields:
        What is to be told how many have.
    """
    from rich import console as consoles  # late, as --help does not need it
    from rich import progress

    console = consoles.Console(stderr=True)
    is_live = console.is_interactive and console.file.isatty()
    with progress.Progress(console=console, transient=True, disable=not is_live) as bar:
        if is_live:
            console.show_cursor(True)  # a process that is killed could not bring it back
        task = bar.add_task(name, total=slews)
        yield lambda flown, total=slews: bar.update(task, completed=flown, total=total)


def write_text(path: Path, text: str) -> None:
    """Write a file.

    Raises:
        FolderError: it cannot be written.
    """
    with run_folder.writing(path):
        destinations.write(path, text)


def write_json(file: Path | TextIO, content: dict | list[dict]) -> None:
    """Write JSON into a path, or to a stream.

    Raises:
        FolderError: the path cannot be written.
    """
    text = json.dumps(content, indent=2) + "\n"
    if isinstance(file, Path):
        write_text(file, text)
    else:
        print(text, end="", file=file, flush=True)


def draw(flight: Any, rows: list[dict], folder: Path) -> list[Path]:
    """Draw a :class:`attjax.evaluation.plots.Flight`, and the training before it where there are
    its rows.

    Returns:
        The files written.
    """
    from attjax.evaluation import plots
    from attjax.runs import learning_curve

    written = plots.write_all(flight, folder)
    return written + learning_curve.write(rows, flight.is_the_papers, folder)


def metrics_rows(folder: Path) -> list[dict]:
    """The rows of a run's metrics.csv, for the learning curve."""
    from attjax.runs import metrics_file

    return metrics_file.read_rows(folder / run_folder.METRICS)
