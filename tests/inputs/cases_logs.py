"""Logs with stamps, units and headers that are odd: read as written, or refused at once in one line."""

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
from corpus import Case

from jaxsub.recording import Recording, load

T = 0.5 * np.arange(20)
U = np.sin(T)
MAGIC = b"\x89MCAP0\r\n"


def mcap(path: Path, topics: dict[str, tuple[np.ndarray, np.ndarray]], shift: float = 0.0) -> None:
    """A log of JSON messages `{"x": value}`; their publish time is `shift` s after the log time."""
    from mcap.writer import Writer

    with path.open("wb") as file:
        log = Writer(file)
        log.start()
        schema = log.register_schema("any", "jsonschema", b"{}")
        for topic, (times, values) in topics.items():
            key = log.register_channel(topic, "json", schema)
            for t, value in zip(times, values, strict=True):
                now = round(1e9 * t)
                log.add_message(key, now, json.dumps({"x": float(value)}).encode(), max(0, now + round(1e9 * shift)))
        log.finish()


def _mcap(name, columns, topics, *refused, check: Callable | None = None, shift=0.0, **settings):
    def make(folder: Path) -> object:
        mcap(folder / "run.mcap", topics, shift)
        return load(folder / "run.mcap", columns, **settings)

    return Case(name, make, refused, check)


def _raw(name, file, content, *refused, columns=None):
    def make(folder: Path) -> object:
        (folder / file).write_bytes(content)
        return load(folder / file, columns or {"r": "gyro.x"})

    return Case(name, make, refused)


def _is(column, values, times=None, finding=""):
    def check(run: object) -> None:
        assert isinstance(run, Recording)
        np.testing.assert_allclose(run.column(column), values, atol=1e-9)
        if times is not None:
            np.testing.assert_allclose(run.times, times, atol=1e-6)
        said = " | ".join(found.line() for found in run.findings)
        assert finding in said and bool(finding) == bool(said), said

    return check


def _with(times, index, stamp):
    changed = times.copy()
    changed[index] = stamp
    return changed


EPOCH = 1.7e9 + T
ONE = {"r": "gyro.x"}
TWO = {"r": "gyro.x", "d": "fin.x"}
NORTH = np.deg2rad((340.0 + 4.0 * T) % 360.0)
MESSAGES = [
    _mcap("log, publish time 0", ONE, {"gyro": (EPOCH, U)}, check=_is("r", U, T), shift=-2e9),
    _mcap("log, publish time late", ONE, {"gyro": (EPOCH, U)}, check=_is("r", U, T), shift=100.0),
    _mcap(
        "log, boot and epoch",
        TWO,
        {"gyro": (EPOCH, U), "fin": (T, U)},
        "columns have no time in common",
        "whether clocks differ",
    ),
    _mcap(
        "log, boot and epoch, one held",
        TWO,
        {"gyro": (EPOCH, U), "fin": (T, U)},
        "no time in common",
        held=["d"],
    ),
    _mcap(
        "log, no sample left of an output",
        TWO,
        {"gyro": (T, U), "fin": (20.0 + T, U)},
        "column 'r': has no sample in the rows",
        held=["d"],
    ),
    _mcap(
        "log, one stamp in 1970",
        ONE,
        {"gyro": (_with(EPOCH, 3, 0.0), U)},
        check=_is("r", np.delete(U, 3), np.delete(T, 3), "1 of 20 samples are dated 0 s"),
    ),
    _mcap(
        "log, one stamp a day off",
        ONE,
        {"gyro": (_with(EPOCH, 3, EPOCH[3] + 86400.0), U)},
        check=_is("r", np.delete(U, 3), np.delete(T, 3), "far from the others"),
    ),
    _mcap(
        "log, half of the stamps in 1970",
        TWO,
        {"gyro": (np.where(T < 5.0, T, EPOCH), U), "fin": (EPOCH, U)},
        "column 'r'",
        "partly since boot and partly since 1970",
    ),
    _mcap(
        "log, compass through north",
        {"psi[rad]": "compass.x", "r": "gyro.x"},
        {"compass": (T[::4], NORTH[::4]), "gyro": (T[:17], U[:17])},
        check=_is("psi", np.deg2rad(340.0 + 4.0 * T[:17])),
        interpolated=["psi"],
    ),
    _mcap(
        "log, offset and factor", {"r": "(gyro.x - 1500) * 0.001"}, {"gyro": (T, U)}, check=_is("r", (U - 1500) / 1e3)
    ),
    _mcap("log, 90 - x in deg", {"r[deg]": "90 - gyro.x"}, {"gyro": (T, U)}, check=_is("r", np.deg2rad(90 - U))),
    _mcap("log, no such channel", {"r": "gyro.y"}, {"gyro": (T, U)}, "no channel 'gyro.y'", "did you mean 'gyro.x'?"),
    _mcap(
        "log, operators without blanks", {"r": "gyro.x-1"}, {"gyro": (T, U)}, "no channel 'gyro.x-1'", "blanks around"
    ),
    _mcap("log, two channels", {"r": "gyro.x + fin.x"}, {"gyro": (T, U)}, "takes fin.x and gyro.x", "one channel"),
    _mcap("log, code for a column", {"r": "__import__('os').system('x')"}, {"gyro": (T, U)}, "column 'r'"),
    _mcap("log, header twice", {"r": "gyro.x", "r[deg]": "gyro.x"}, {"gyro": (T, U)}, "is there already"),
]


def _record(opcode: int, length: int, content: bytes = b"") -> bytes:
    return struct.pack("<BQ", opcode, length) + content


ULOG = b"ULog\x01\x12\x35\x01" + bytes(8) + struct.pack("<HB", 40, ord("B")) + bytes(40)
FORMAT = b"big:uint64_t timestamp;float[999999999] x;"
LONG = struct.pack("<HB", len(FORMAT), ord("F")) + FORMAT
DAMAGED = [
    _raw("MCAP, a record of 2**40 bytes", "run.mcap", MAGIC + _record(1, 2**40, b"x" * 20), "can be read", "break off"),
    _raw("MCAP, only its magic", "run.mcap", MAGIC, "run.mcap"),
    _raw(
        "ULog, an array of 10**9", "run.ulg", ULOG + struct.pack("<HB", len(LONG), ord("F")) + LONG, "claims an array"
    ),
    _raw("ULog, only its head", "run.ulg", ULOG, "run.ulg"),
    _raw("dataflash, messages of no length", "run.bin", b"\xa3\x95\x80\x80\x00" * 9, "claims messages of 0 bytes"),
    _raw("dataflash of nonsense", "run.bin", b"nonsense" * 20, "does not begin like a dataflash log"),
    _raw("telemetry of nonsense", "run.tlog", b"nonsense" * 20, "holds no MAVLink message"),
    _raw("ROS bag of nonsense", "run.bag", b"#ROSBAG V2.0\n" + b"\xff" * 200, "cannot be read"),
    _raw("ROS bag, a header of 2**31 bytes", "run.bag", b"#ROSBAG V2.0\n" + b"\xff\xff\xff\x7f" * 9, "cannot be read"),
    _raw(
        "Slocum of nonsense",
        "run.dbd",
        b"dbd_label: x\nnum_ascii_tags: 99999999\n",
        "claims 99999999 for num_ascii_tags",
    ),
    _raw("an empty log", "run.ulg", b"", "is empty"),
]
CASES = [*MESSAGES, *DAMAGED]
