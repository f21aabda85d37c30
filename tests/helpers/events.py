"""The event files of --tensorboard, read."""

import struct

from tensorboardX.proto.event_pb2 import Event
from tensorboardX.proto.plugin_hparams_pb2 import HParamsPluginData
from tensorboardX.record_writer import masked_crc32c


def records(folder):
    """The events of the folder's only event file, each with its checksums checked."""
    (path,) = (folder / "tensorboard").iterdir()
    data = path.read_bytes()
    while data:
        size, check = struct.unpack("<QI", data[:12])
        assert check == masked_crc32c(data[:8])
        assert struct.unpack("<I", data[12 + size : 16 + size])[0] == masked_crc32c(
            data[12:][:size]
        )
        yield Event.FromString(data[12:][:size])
        data = data[16 + size :]


def points(folder):
    """{tag: [(step, value)]} of all curves."""
    curves = {}
    for event in records(folder):
        for value in event.summary.value:
            if not value.tag.startswith("_hparams_"):
                curves.setdefault(value.tag, []).append((event.step, value.simple_value))
    return curves


def compared(folder):
    """The tags that the tab HPARAMS shows beside the settings."""
    (value,) = list(records(folder))[2].summary.value
    data = HParamsPluginData.FromString(value.metadata.plugin_data.content)
    return [info.name.tag for info in data.experiment.metric_infos]
