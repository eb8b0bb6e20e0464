"""What every log can be asked: what it holds, and the samples of a channel at their own times."""

import abc
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from ...errors import InputError, nearest
from ...findings import Finding


class Channel(NamedTuple):
    """One row of a log's contents: name, unit (empty where the log states none) and number of samples."""

    name: str
    unit: str
    samples: int


class Listing(NamedTuple):
    """The channels of a file in its own order, and what was found in reading it."""

    channels: list[Channel]
    findings: tuple[Finding, ...] = ()


class Series(NamedTuple):
    """Samples of one channel: times (n,) s on the log's clock, values (n,), and their unit or an empty text."""

    times: np.ndarray
    values: np.ndarray
    unit: str = ""


class Log(abc.ABC):
    """A file or folder of channels by name, such as `vehicle_attitude.q[0]` or `/imu.angular_velocity.z`.

    Once it has been read, `losses` says in what the file itself shows to be incomplete: each entry the predicate of a
    sentence about it. What its package prints of that is not among them.
    """

    def __init__(self) -> None:
        self.losses: list[str] = []

    @abc.abstractmethod
    def channels(self) -> list[Channel]:
        """Everything in the log that is a number, in its own order."""

    @abc.abstractmethod
    def series(self, names: list[str]) -> dict[str, Series]:
        """The samples of the channels `names`; those that the log does not hold are left out."""


class MessageLog(Log):
    """A log of messages by topic, each a tree of numbers and lists; its channels are `topic.field.part[index]`."""

    # of a list, such as an image, no more than this many entries are listed; any may be requested
    LISTED = 32

    @abc.abstractmethod
    def topics(self) -> Mapping[str, int]:
        """How many messages each topic holds."""

    @abc.abstractmethod
    def messages(self, topics: list[str]) -> Iterator[tuple[str, float, Any]]:
        """Topic, time of logging (s) and content of each message of those topics, in the log's order."""

    def channels(self) -> list[Channel]:
        """Every number of the first message of each topic."""
        counts = dict(self.topics())
        found: dict[str, list[Channel]] = {topic: [] for topic in counts}
        for topic in counts:
            for _, _, message in self.messages([topic]):
                found[topic] = [Channel(name, "", counts[topic]) for name in _numbers(message, topic, self.LISTED)]
                break
        return [channel for listed in found.values() for channel in listed]

    def series(self, names: list[str]) -> dict[str, Series]:
        """A message is dated by its `header.stamp`, where it has one that is not zero, else by when it was logged."""
        topics = self.topics()
        of: dict[str, list[tuple[str, list[str | int]]]] = {}
        for name in names:
            topic = max((t for t in topics if name.startswith((f"{t}.", f"{t}["))), key=len, default=None)
            if topic is not None:
                of.setdefault(topic, []).append((name, _keys(name[len(topic) :])))
        samples: dict[str, list[tuple[float, float]]] = {}
        for topic, logged, message in self.messages(list(of)) if of else ():
            time = _stamp(message) or logged
            for name, keys in of[topic]:
                if (value := _number(_at(message, keys))) is not None:
                    samples.setdefault(name, []).append((time, value))
        return {name: _in_order(np.array(pairs)) for name, pairs in samples.items()}


def taken(log: Log, source: str, names: list[str]) -> dict[str, Series]:
    """The samples of every one of `names`. Raises InputError for one that the log does not hold."""
    found = log.series(names)
    for name in names:
        if name not in found:
            close = nearest(name, [channel.name for channel in log.channels()])
            remedy = f"did you mean {close!r}?" if close else f"`jaxsub channels {source}` lists what it holds"
            if re.search(r"[-+/]\d|\d[-+/]", name):
                remedy += "; in arithmetic, set blanks around + - /"
            raise InputError(source, f"holds no channel {name!r}", remedy)
    return found


def _in_order(pairs: np.ndarray) -> Series:
    """Rows of time and value in order of time; of equal times in the log's."""
    return Series(*pairs[np.argsort(pairs[:, 0], kind="stable")].T)


def _keys(path: str) -> list[str | int]:
    """The way into a message that `.position[3]` stands for."""
    return [int(index) if index else name for name, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", _dotted(path))]


def _dotted(path: str) -> str:
    # a bare number between brackets is an index and no name
    return re.sub(r"\[(\d+)\]", r".[\1]", path)


def _at(message: Any, keys: list[str | int]) -> Any:
    for key in keys:
        if isinstance(key, int):
            message = message[key] if _is_list(message) and key < len(message) else None
        elif isinstance(message, Mapping):
            message = message.get(key)
        else:
            message = getattr(message, key, None)
    return message


def _numbers(value: Any, name: str, longest: int) -> Iterator[str]:
    if _number(value) is not None:
        yield name
    elif isinstance(value, Mapping):
        for key, part in value.items():
            yield from _numbers(part, f"{name}.{key}", longest)
    elif _is_list(value):
        for index, part in enumerate(value[:longest]):
            yield from _numbers(part, f"{name}[{index}]", longest)
    else:
        for key in getattr(value, "__dataclass_fields__", ()):
            if not key.startswith("__"):
                yield from _numbers(getattr(value, key), f"{name}.{key}", longest)


def _is_list(value: Any) -> bool:
    return isinstance(value, list | tuple | np.ndarray)


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, bool | int | float | np.number | np.bool_) else None


def _stamp(message: Any) -> float | None:
    """Seconds of a ROS header's stamp, under any of the names that its versions give the parts."""
    stamp = _at(message, ["header", "stamp"])
    seconds = [_number(_at(stamp, [key])) for key in ("sec", "secs")]
    parts = [_number(_at(stamp, [key])) for key in ("nanosec", "nsec", "nsecs")]
    whole, rest = (next((x for x in found if x is not None), 0.0) for found in (seconds, parts))
    return whole + 1e-9 * rest if whole or rest else None
