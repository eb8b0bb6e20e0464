"""MCAP files (.mcap) whose messages are JSON, or ROS 1 or ROS 2 messages that carry their definitions."""

import json
import os
import struct
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from ...errors import InputError, optional
from ..bounds import require_plausible
from .log import MessageLog

_NANO = 1e-9
_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # of a record: its kind and its length, bytes
_NO_RECORD = 0  # a kind that no version of the format has


class _Message(NamedTuple):
    """One message as the file holds it: its channel, that channel's schema or None, log time (ns) and bytes."""

    channel: Any
    schema: Any
    time: int
    data: bytes


class McapLog(MessageLog):
    """Read by the package mcap, and ROS messages in it by rosbags; a message's time is its log time.

    The file is read from its beginning and not by the index at its end, which the log of an interrupted vehicle lacks.
    Chunks whose checksum is not that of their content are left out, and so is what follows the place where records end.
    Source: mcap.dev, MCAP Format Specification.
    """

    def __init__(self, path: Path):
        super().__init__()
        self._path = path
        self._records = optional("mcap.records", "logs", str(path))
        self._streams = optional("mcap.stream_reader", "logs", str(path))
        self._unsupported = optional("mcap.exceptions", "logs", str(path)).UnsupportedCompressionError
        self._counts: Counter[str] | None = None

    def topics(self) -> Mapping[str, int]:
        """By counting, once."""
        if self._counts is None:
            self._counts = Counter()
            self._counts.update(message.channel.topic for message in self._messages(self.losses))
            if self.losses and not self._counts:
                what = f"holds no message that can be read: {'; '.join(self.losses)}"
                raise InputError(str(self._path), what, "check that it was copied whole")
        return self._counts

    def messages(self, topics: list[str]) -> Iterator[tuple[str, float, Any]]:
        """Raises InputError for a topic in an encoding that is not read."""
        decoders: dict[int, Callable[[bytes], Any]] = {}
        for channel, schema, time, data in self._messages([]):
            if channel.topic in topics:
                if channel.id not in decoders:
                    decoders[channel.id] = self._decoder(channel, schema)
                yield channel.topic, _NANO * time, decoders[channel.id](data)

    def _messages(self, losses: list[str]) -> Iterator[_Message]:
        """All messages in the file's order; what cannot be read is appended to `losses`."""
        schemas: dict[int, Any] = {}
        channels: dict[int, Any] = {}
        kinds, unknown = self._records, 0
        for record in self._sections(losses):
            if isinstance(record, kinds.Schema):
                schemas[record.id] = record
            elif isinstance(record, kinds.Channel):
                channels[record.id] = record
            elif isinstance(record, kinds.Message):
                if channel := channels.get(record.channel_id):
                    yield _Message(channel, schemas.get(channel.schema_id), record.log_time, record.data)
                else:
                    unknown += 1
        if unknown:
            losses.append(f"{unknown} messages are of channels whose definition is lost")

    def _sections(self, losses: list[str]) -> Iterator[Any]:
        """Schemas, channels and messages up to the end of the data section, also those in chunks."""
        size = os.path.getsize(self._path)
        with self._path.open("rb") as file:
            if file.read(len(_MAGIC)) != _MAGIC:
                raise InputError(str(self._path), "does not begin like an MCAP file", "check that it is one")
            while (place := file.tell()) < size:
                head = file.read(_HEAD.size)
                kind, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (_NO_RECORD, 0)
                if kind == _NO_RECORD or length > size - file.tell():
                    losses.append(f"its records break off at byte {place} of {size}")
                    return
                if kind == self._records.Opcode.DATA_END:
                    return
                try:
                    found = self._parsed(kind, file.read(length))
                except (InputError, self._unsupported):
                    raise
                except Exception as error:  # the package and its decompressors promise no kind of error
                    said = str(error) or type(error).__name__
                    losses.append(f"{length} bytes from byte {file.tell() - length} cannot be read ({said})")
                    continue
                yield from found
            losses.append("its records end without the mark of the data's end")

    def _parsed(self, kind: int, body: bytes) -> list[Any]:
        """The schemas, channels and messages of a record.

        Raises InputError where a chunk claims to expand to more than it plausibly holds.
        """
        kinds, stream = self._records, self._streams.ReadDataStream(BytesIO(body))
        if kind == kinds.Opcode.CHUNK:
            chunk = kinds.Chunk.read(stream)
            require_plausible(str(self._path), chunk.uncompressed_size, len(body))
            records: list[Any] = self._streams.breakup_chunk(chunk, validate_crc=True)
            return records
        if kind == kinds.Opcode.MESSAGE:
            return [kinds.Message.read(stream, len(body))]
        form = {kinds.Opcode.SCHEMA: kinds.Schema, kinds.Opcode.CHANNEL: kinds.Channel}.get(kind)
        return [] if form is None else [form.read(stream)]

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
