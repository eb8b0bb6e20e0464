"""ArduPilot's logs: dataflash (.bin), which the vehicle writes, and telemetry (.tlog), which a ground station does."""

import contextlib
import mmap
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, optional
from .log import Channel, Log, MessageLog, Series

_MICRO = 1e-6
_FORMAT = b"\xa3\x95\x80"  # the head of a message that describes others
_DEFINITIONS = ("FMT", "FMTU", "UNIT", "MULT")
_SHORTEST = 3  # bytes of a message: its head
_STAMP = 8  # bytes before each message of telemetry
_SPELT = {
    "UNKNOWN": "", "instance": "", "satellites": "", "enum": "", "bitmask": "", "deglatitude": "deg",
    "deglongitude": "deg", "degheading": "deg", "Gauss": "gauss", "mGauss": "milligauss", "us": "µs", "cm/s": "cm/s",
    "mrad/s": "mrad/s", "cdeg": "centideg", "deg/s/s": "deg/s^2", "m/s/s": "m/s^2", "%": "percent",
}  # fmt: skip


class DataFlash(Log):
    """Channels are `MSG.Field`, or `MSG[1].Field` of messages that say which of several sensors they are from.

    Samples are dated by `TimeUS`, s since boot. Units are those that the log states in its FMTU messages.
    """

    def __init__(self, path: Path):
        super().__init__()
        self._path = path
        self._package = optional("pymavlink.DFReader", "logs", str(path))

    def channels(self) -> list[Channel]:
        """Every number of every kind of message that is dated."""
        with self._file() as file:
            counts: Counter[str] = Counter()
            found: dict[str, list[tuple[str, str]]] = {}
            for name, message in self._messages(file, self._dated(file)):
                counts[name] += 1
                if name not in found:
                    found[name] = [(field, _unit(message, field)) for field in _fields(message.fmt)]
            return [Channel(f"{name}.{f}", unit, counts[name]) for name, listed in found.items() for f, unit in listed]

    def series(self, names: list[str]) -> dict[str, Series]:
        """Only the requested messages are decoded."""
        wanted: dict[str, list[str]] = {}
        for name in names:
            topic, _, field = name.partition(".")
            wanted.setdefault(topic, []).append(field)
        samples: dict[str, list[tuple[float, float]]] = {}
        units: dict[str, str] = {}
        with self._file() as file:
            kinds = {topic.partition("[")[0] for topic in wanted} & set(self._dated(file))
            for topic, message in self._messages(file, sorted(kinds)) if kinds else ():
                for field in wanted.get(topic, ()):
                    if field in _fields(message.fmt):
                        name = f"{topic}.{field}"
                        samples.setdefault(name, []).append((_MICRO * message.TimeUS, float(getattr(message, field))))
                        units[name] = _unit(message, field)
        return {name: Series(*np.array(pairs).T, unit=units[name]) for name, pairs in samples.items()}

    @contextlib.contextmanager
    def _file(self) -> Iterator[Any]:
        self._check()
        kind: Any = self._package.DFReader_binary
        file: Any = kind.__new__(kind)  # to be closed also where its making fails
        try:
            kind.__init__(file, str(self._path))
            self.losses = _losses(file)
            yield file
        finally:
            if "filehandle" in vars(file):
                file.filehandle.close()

    def _check(self) -> None:
        """Raise InputError for what the reader would take for ever over: no such log, or messages of no length."""
        with self._path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            if data[:3] != _FORMAT:
                raise InputError(str(self._path), "does not begin like a dataflash log", "check that it is one")
            place = 0
            while (place := data.find(_FORMAT, place)) >= 0:
                if place + 5 <= len(data) and data[place + 4] <= _SHORTEST:
                    what = f"claims messages of {data[place + 4]} bytes at byte {place}"
                    raise InputError(str(self._path), what, "check that it is whole")
                place += len(_FORMAT)

    def _dated(self, file: Any) -> list[str]:
        kinds = {name: file.formats[key] for name, key in file.name_to_id.items()}
        return [name for name, form in kinds.items() if "TimeUS" in form.colhash and name not in _DEFINITIONS]

    def _messages(self, file: Any, kinds: list[str]) -> Iterator[tuple[str, Any]]:
        """Each message of those kinds, under its name as channels have it."""
        while kinds and (message := file.recv_match(type=kinds)) is not None:
            instance = message.fmt.instance_field
            name = message.get_type()
            yield (name if instance is None else f"{name}[{getattr(message, instance)}]"), message


class Telemetry(MessageLog):
    """Channels are `MSG.field`, or `MSG[1.1].field` where several systems and components send that message.

    Samples are dated by when the ground station received them.
    """

    def __init__(self, path: Path):
        super().__init__()
        self._path = path
        self._package = optional("pymavlink.mavutil", "logs", str(path))
        self._units: dict[str, Mapping[str, str]] = {}
        self._counts: dict[str, int] = {}
        self._shared: set[str] = set()

    def topics(self) -> Mapping[str, int]:
        """By counting, once."""
        if not self._counts:
            counts: Counter[tuple[str, str]] = Counter()
            for kind, source, message in self._received():
                counts[kind, source] += 1
                self._units[kind] = message.fieldunits_by_name
            if not counts:
                raise InputError(str(self._path), "holds no MAVLink message", "check that it is a telemetry log")
            kinds = Counter(kind for kind, _ in counts)
            self._shared = {kind for kind, sources in kinds.items() if sources > 1}
            self._counts = {self._topic(kind, source): count for (kind, source), count in counts.items()}
        return self._counts

    def messages(self, topics: list[str]) -> Iterator[tuple[str, float, Any]]:
        """The fields of each message by name."""
        self.topics()
        for kind, source, message in self._received():
            if (topic := self._topic(kind, source)) in topics:
                yield topic, message._timestamp, {name: getattr(message, name) for name in message.get_fieldnames()}

    def channels(self) -> list[Channel]:
        """With the units that MAVLink's definitions state."""
        return [channel._replace(unit=self._stated(channel.name)) for channel in super().channels()]

    def series(self, names: list[str]) -> dict[str, Series]:
        """With the units that MAVLink's definitions state."""
        return {name: one._replace(unit=self._stated(name)) for name, one in super().series(names).items()}

    def _topic(self, kind: str, source: str) -> str:
        return f"{kind}[{source}]" if kind in self._shared else kind

    def _stated(self, name: str) -> str:
        topic, _, field = name.rpartition(".")
        unit = self._units.get(topic.partition("[")[0], {}).get(field.partition("[")[0], "")
        return _SPELT.get(unit, unit)

    def _received(self) -> Iterator[tuple[str, str, Any]]:
        file = self._package.mavlogfile(str(self._path))
        try:
            strange = file.filesize
            while (message := file.recv_msg()) is not None:
                kind = message.get_type()
                if kind == "BAD_DATA":
                    continue
                strange -= _STAMP + len(message.get_msgbuf())
                if not kind.startswith("UNKNOWN"):
                    yield kind, f"{message.get_srcSystem()}.{message.get_srcComponent()}", message
            self.losses = [f"{strange} of its {file.filesize} bytes are no message"] if strange else []
        finally:
            file.close()


def _losses(file: Any) -> list[str]:
    """Bytes of a dataflash log, as its index has it, that belong to no message, and a last message that is cut.

    What follows the last message is no loss unless it begins like one: such logs are written in pages.
    """
    messages = [(places, file.formats[kind].len) for kind, places in enumerate(file.offsets) if len(places)]
    end = max((int(places[-1]) + length for places, length in messages), default=0)
    losses = [f"{stray} of its bytes are no message"] if (stray := end - sum(len(p) * n for p, n in messages)) else []
    cut = end > file.data_len or file.data_map[end : end + 1] == _FORMAT[:1]
    return [*losses, "it ends within a message"] if cut else losses


def _fields(fmt: Any) -> list[str]:
    """The fields of a message that are numbers, but for its time."""
    kinds = zip(fmt.columns, fmt.msg_types, strict=False)
    return [name for name, kind in kinds if kind in (int, float) and name not in ("TimeUS", fmt.instance_field)]


def _unit(message: Any, field: str) -> str:
    unit: str = message.fmt.get_unit(field)
    return _SPELT.get(unit, unit)
