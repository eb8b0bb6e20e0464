"""PX4's ULog (.ulg), read by pyulog."""

import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, optional
from .log import Channel, Log, Series

_MICRO = 1e-6  # its stamps are in µs
_HEAD = 3  # bytes of a message: its length and kind
_LONGEST = 2**16  # bytes of a message
_DEFINITIONS = 2**22  # bytes of a log that hold its formats


class _Counted(io.BufferedReader):
    """A file that knows, once it has been read, whether it ended within a message."""

    ends_within = False

    def __init__(self, path: Path):
        super().__init__(io.FileIO(path))

    def read(self, size: int | None = -1) -> bytes:
        """The next `size` bytes. At the end of a whole file the reader requests a message's head and gets nothing."""
        data = super().read(size)
        asked = size or 0
        self.ends_within = 0 < len(data) < asked or (not data and asked > _HEAD)
        return data


class ULog(Log):
    """Channels are `topic.field`; a second instance of a topic is `topic[1].field`.

    A sample is dated by `timestamp_sample` where its topic has one, which is when the sensor was read, else by
    `timestamp`. Source: docs.px4.io, ULog File Format.
    """

    def __init__(self, path: Path):
        super().__init__()
        self._path = path
        self._package = optional("pyulog", "logs", str(path))

    def channels(self) -> list[Channel]:
        """Every field of every topic but its stamps."""
        return [
            Channel(f"{_topic(data)}.{field}", "", len(values))
            for data in self._read(None).data_list
            for field, values in data.data.items()
            if not field.startswith("timestamp")
        ]

    def series(self, names: list[str]) -> dict[str, Series]:
        """Only the requested topics are decoded."""
        topics = sorted({name.partition(".")[0].partition("[")[0] for name in names})
        found = {}
        for data in self._read(topics).data_list:
            for field in data.data:
                if (name := f"{_topic(data)}.{field}") in names:
                    found[name] = Series(_MICRO * _stamps(data.data), data.data[field].astype(np.float64))
        return found

    def _read(self, topics: list[str] | None) -> Any:
        with _Counted(self._path) as file:
            self._check(file.read(_DEFINITIONS))
            file.seek(0)
            log = self._package.ULog(file, topics)
        self.losses = ["it ends within a message"] * file.ends_within
        if dropouts := [1e-3 * dropout.duration for dropout in log.dropouts]:
            self.losses.append(f"its logger dropped messages {len(dropouts)} times, {sum(dropouts):.3g} s in all")
        return log

    def _check(self, head: bytes) -> None:
        """Raise InputError for an array longer than a message can be, whose parts the reader would name one by one."""
        for count in re.findall(rb"\w\[(\d+)\] \w", head):
            if int(count[:9]) > _LONGEST:
                what = f"claims an array of {count[:20].decode()} numbers in a message"
                raise InputError(str(self._path), what, "check that it is whole")


def _topic(data: Any) -> str:
    return data.name if data.multi_id == 0 else f"{data.name}[{data.multi_id}]"


def _stamps(fields: dict[str, np.ndarray]) -> np.ndarray:
    sampled = fields.get("timestamp_sample", fields["timestamp"])
    return np.where(sampled > 0, sampled, fields["timestamp"]).astype(np.float64)
