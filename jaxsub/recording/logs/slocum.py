"""Slocum gliders' binary files (.dbd, .ebd, .sbd, .tbd, .mbd, .nbd and compressed .?cd), read by dbdreader."""

import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError, optional
from .log import Channel, Log, Series

# what a glider calls numbers without a unit; dbdreader turns positions into degrees
_BARE = {"nodim", "enum", "bool", "bit", "byte", "bytes", "mbytes"}
_SPELT = {
    "sec": "s", "secs": "s", "timestamp": "s", "rad/sec": "rad/s", "rad-sec": "rad s", "degc": "degC", "s/m": "S/m",
    "cc": "cm^3", "in": "inch", "volts": "V", "amps": "A", "watts": "W", "amp-hrs": "A hour", "lat": "deg",
    "lon": "deg",
}  # fmt: skip
_HEADER = 4096  # bytes in which it stands
_TAGS, _SENSORS = 100, 50_000  # a glider has 14 and 1400
_END = b"X"
_CLOCKS = ("m_present_time", "sci_m_present_time")


class SlocumLog(Log):
    """Channels are the glider's sensors, such as `m_depth`, with the units that the file states.

    Only cycles in which a sensor was updated are samples. A file that does not list its sensors needs the glider's
    cache files (.cac) in a folder `cac` or `cache` beside it, or in the file's own.
    """

    def __init__(self, path: Path):
        super().__init__()
        self._path = path
        self._package = _dbdreader(str(path))

    def channels(self) -> list[Channel]:
        """Every sensor that was updated at least once."""
        with self._file() as file:
            names = [name for name in file.parameterNames if name not in _CLOCKS]
            taken = zip(names, file.get(*names), strict=True)
            return [Channel(n, _unit(file, n), len(times)) for n, (times, _) in taken if len(times)]

    def series(self, names: list[str]) -> dict[str, Series]:
        """Times are those of the glider's or the science computer's own clock."""
        with self._file() as file:
            known = [name for name in names if name in file.parameterNames]
            if not known:
                return {}
            samples = file.get(*known) if len(known) > 1 else [file.get(*known)]
            return {n: Series(*_in_order(*pair), _unit(file, n)) for n, pair in zip(known, samples, strict=True)}

    def _check(self) -> None:
        """Raise InputError for a header that claims more lines than a file has, which the reader would wait for."""
        with self._path.open("rb") as file:
            head = file.read(_HEADER)
        for key, count in re.findall(rb"^(num_ascii_tags|total_num_sensors|sensors_per_cycle):\s*(\d+)", head, re.M):
            if len(count) > 5 or int(count) > (_TAGS if key == b"num_ascii_tags" else _SENSORS):
                what = f"claims {count[:20].decode()} for {key.decode()}"
                raise InputError(str(self._path), what, "check that it is whole")

    @contextmanager
    def _file(self) -> Iterator[Any]:
        self._check()
        beside = [self._path.parent / name for name in ("cac", "cache")]
        folder = next((folder for folder in beside if folder.is_dir()), None)
        if folder is None and any(self._path.parent.glob("*.[cC][aA][cC]")):
            folder = self._path.parent
        # the package leaves cache files of its own in the folder that it is given
        with tempfile.TemporaryDirectory(prefix="jaxsub-") as scratch:
            file = self._package.DBD(str(self._path), cacheDir=str(folder or scratch))
            self.losses = ["it lacks the mark that closes it"] * (not self._is_closed())
            try:
                yield file
            finally:
                file.close()

    def _is_closed(self) -> bool:
        """Whether the last byte is the mark that a glider writes when it closes a file."""
        packed = self._package.decompress
        if packed.is_compressed(str(self._path)):
            content = packed.Decompressor(str(self._path)).decompress()
        else:
            content = self._path.read_bytes()
        return bool(content.rstrip().endswith(_END))


def _unit(file: Any, name: str) -> str:
    unit: str = file.parameterUnits[name]
    return "" if unit in _BARE else _SPELT.get(unit.lower(), unit)


def _dbdreader(where: str) -> Any:
    try:
        return optional("dbdreader", "logs", where)
    except FileExistsError:  # another process made, at the same moment, the folder that the first import makes
        for half_imported in [name for name in sys.modules if name.startswith("dbdreader.")]:
            del sys.modules[half_imported]
        return optional("dbdreader", "logs", where)


def _in_order(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    kept = np.isfinite(times)
    return times[kept].astype(np.float64), values[kept].astype(np.float64)
