"""ROS bags: a ROS 1 file (.bag), or a ROS 2 folder with its metadata.yaml or a file of one (.db3), read by rosbags."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ...errors import optional
from .log import MessageLog

_NANO = 1e-9


class RosBag(MessageLog):
    """Messages whose definitions the bag does not carry are taken for those of ROS 2 Humble."""

    def __init__(self, path: Path):
        super().__init__()
        types = optional("rosbags.typesys", "logs", str(path))
        self._reader = optional("rosbags.highlevel", "logs", str(path)).AnyReader
        self._open = lambda: self._reader([path], default_typestore=types.get_typestore(types.Stores.ROS2_HUMBLE))

    def topics(self) -> Mapping[str, int]:
        """As the bag's index has it."""
        with self._open() as bag:
            return {name: info.msgcount for name, info in bag.topics.items()}

    def messages(self, topics: list[str]) -> Iterator[tuple[str, float, Any]]:
        """Dated by when the bag received them."""
        with self._open() as bag:
            wanted = [connection for connection in bag.connections if connection.topic in topics]
            for connection, time, data in bag.messages(connections=wanted):
                yield connection.topic, _NANO * time, bag.deserialize(data, connection.msgtype)
