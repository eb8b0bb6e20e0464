"""MCAP files (.mcap) whose messages are JSON, or ROS 1 or ROS 2 messages that carry their definitions."""

import io
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from ...errors import InputError, optional
from ..bounds import require_plausible
from .log import MessageLog

_NANO = 1e-9


class _Clamped(io.BufferedReader):
    """A file that sets no memory aside for more bytes than are left, whatever length its records claim."""

    def __init__(self, path: Path):
        super().__init__(io.FileIO(path))
        self._size = path.stat().st_size

    def read(self, size: int | None = -1) -> bytes:
        """The next bytes, as many as are there."""
        return super().read(size if size is None or size < 0 else min(size, max(0, self._size - self.tell())))


class McapLog(MessageLog):
    """Read by the package mcap, and ROS messages in it by rosbags; a message's time is its log time.

    Source: mcap.dev, MCAP Format Specification.
    """

    def __init__(self, path: Path):
        self._path = path
        self._reader = optional("mcap.reader", "logs", str(path))

    def topics(self) -> Mapping[str, int]:
        """From the summary at the end of the file or, where an interrupted log has none, by counting."""
        with _Clamped(self._path) as file:
            reader = self._reader.make_reader(file)
            summary = reader.get_summary()
            if summary is not None and summary.statistics is not None:
                counts = summary.statistics.channel_message_counts
                return {channel.topic: counts.get(key, 0) for key, channel in summary.channels.items()}
            found: dict[str, int] = {}
            for _, channel, _ in reader.iter_messages():
                found[channel.topic] = found.get(channel.topic, 0) + 1
            return found

    def messages(self, topics: list[str]) -> Iterator[tuple[str, float, Any]]:
        """Raises InputError for a topic in an encoding that is not read."""
        decoders: dict[int, Callable[[bytes], Any]] = {}
        with _Clamped(self._path) as file:
            self._check(file)
            for schema, channel, message in self._reader.make_reader(file).iter_messages(topics):
                if channel.id not in decoders:
                    decoders[channel.id] = self._decoder(channel, schema)
                yield channel.topic, _NANO * message.log_time, decoders[channel.id](message.data)

    def _check(self, file: BinaryIO) -> None:
        """Raise InputError where a chunk claims to expand to more than it plausibly holds."""
        summary = self._reader.make_reader(file).get_summary()
        for chunk in summary.chunk_indexes if summary is not None else ():
            require_plausible(str(self._path), chunk.uncompressed_size, chunk.compressed_size)
        file.seek(0)

    def _decoder(self, channel: Any, schema: Any) -> Callable[[bytes], Any]:
        encoding = channel.message_encoding
        if encoding == "json":
            return json.loads
        if encoding in ("cdr", "ros1") and schema is not None and schema.encoding in ("ros1msg", "ros2msg", "ros2idl"):
            return _ros_decoder(str(self._path), encoding, schema)
        what = f"topic {channel.topic!r} is encoded as {encoding!r}"
        raise InputError(str(self._path), what, "convert it to JSON or ROS 2 messages, or to a .csv file")


def _ros_decoder(source: str, encoding: str, schema: Any) -> Callable[[bytes], Any]:
    types = optional("rosbags.typesys", "logs", source)
    text = schema.data.decode()
    store = types.get_typestore(types.Stores.EMPTY)
    idl = schema.encoding == "ros2idl"
    store.register(types.get_types_from_idl(text) if idl else types.get_types_from_msg(text, _full(schema.name)))
    read = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr
    return lambda data: read(data, _full(schema.name))


def _full(name: str) -> str:
    """`sensor_msgs/Imu`, as ROS 1 writes it, under the full name `sensor_msgs/msg/Imu`."""
    return name if name.count("/") != 1 else name.replace("/", "/msg/")
