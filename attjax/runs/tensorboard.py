"""TensorBoard's event files, ``tensorboard/`` in a run folder; needs tensorboardX.

At each start the file is written anew from the rows of metrics.csv that the run goes on from, then
it grows row by row. So it always tells what metrics.csv tells, whatever happened to the run before.

Only tensorboardX's protocol buffers and checksum are used: its writers work in a thread, where a
full disk ends in a traceback, and put hyperparameters into a further run beside the curves.
"""

import struct
import time
from pathlib import Path
from typing import Any

from tensorboardX.proto.event_pb2 import Event, SessionLog
from tensorboardX.proto.summary_pb2 import Summary
from tensorboardX.record_writer import masked_crc32c
from tensorboardX.summary import hparams

from attjax.config import run as run_config
from attjax.runs import belongings, metrics, metrics_file
from attjax.runs import folder as run_folder

RATE = "time/steps_per_s"
"""Agent steps a second between two rows."""


class EventFile:
    """The event file of a run; each row is in it when ``append`` returns.

    Args:
        folder: of the run; open.
        config: shown in the tab HPARAMS.
        rows: of metrics.csv, to begin with.

    Raises:
        FolderError: it cannot be written.
    """

    def __init__(self, folder: Path, config: run_config.Config, rows: list[dict[str, str]]) -> None:
        self._folder = folder
        self._last: tuple[int, float] | None = None
        seconds = float(rows[-1]["wall_s"]) if rows else 0.0
        self._start = time.time() - seconds  # as if the run had never paused
        events = [*_head(self._start, config), *(self._event(row) for row in rows)]
        run = run_folder.run_id(folder)
        self._path = folder / belongings.EVENTS / belongings.event_name(time.time_ns(), run)
        with run_folder.writing(folder):
            self._path.parent.mkdir(exist_ok=True)
            belongings.remove_events(folder, run)
            run_folder.replace(self._path, b"".join(map(_record, events)))

    def append(self, row: dict[str, Any]) -> None:
        """Add one row of metrics.

        Raises:
            FolderError: it cannot be written.
        """
        record = _record(self._event(metrics_file.cells(row)))
        with run_folder.writing(self._folder), self._path.open("ab") as file:
            file.write(record)

    def _event(self, cells):
        """The curves' next points; cells that are empty make none."""
        tags = {metric.name: metric.tag for metric in metrics.METRICS if metric.tag}
        values = {tags[name]: float(x) for name, x in cells.items() if name in tags and _is_set(x)}
        steps, seconds = int(cells["agent_steps"]), float(cells["wall_s"])
        last_steps, last_seconds = self._last or (0, 0.0)
        if seconds > last_seconds:
            values[RATE] = (steps - last_steps) / (seconds - last_seconds)
        self._last = steps, seconds
        points = [Summary.Value(tag=tag, simple_value=x) for tag, x in values.items()]
        return Event(step=steps, wall_time=self._start + seconds, summary=Summary(value=points))


def _is_set(cell):
    return cell not in (None, "")


def _head(wall_time, config):
    """What an event file begins with; a TensorBoard that shows an older one starts over."""
    yield Event(wall_time=wall_time, file_version="brain.Event:2")
    yield Event(wall_time=wall_time, session_log=SessionLog(status=SessionLog.START))
    values = {"preset": config.preset, "seed": config.seed, "spacecraft": config.spacecraft.name}
    values |= config.settings.flat
    shown = {k: ",".join(map(str, v)) if isinstance(v, tuple) else v for k, v in values.items()}
    # The session's end is left out: it would say that the run has ended, and how.
    compared = dict.fromkeys(metric.tag for metric in metrics.METRICS if metric.is_compared)
    for summary in hparams(shown, compared)[:2]:
        yield Event(wall_time=wall_time, summary=summary)


def _record(event):
    """The event framed as in TFRecord files: length, its checksum, data, its checksum."""
    data = event.SerializeToString()
    length = struct.pack("<Q", len(data))
    checksums = [struct.pack("<I", masked_crc32c(part)) for part in (length, data)]
    return length + checksums[0] + data + checksums[1]
