r"""The paper's sensor interface card, simulated: what its serial line of 9600 bit/s makes of the sensors' readings.

A frame is little-endian: a sync word, a byte that says whether there is a fix, a sequence number, the time in ticks of
0.1 ms, three gyros and three accelerometers as 16-bit shares of the ranges of the ADXRS150 and the ADXL105, a fix in
mm if there is one, and the checksum CRC-16 (CCITT, from all ones) of all between sync word and checksum.

23 bytes, or 35 with a fix: with 10 bits on the line for each byte, no more than 41 frames a second.
"""

import binascii
import math
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ..effects import GRAVITY
from ..errors import InputError

GYRO_RANGE = math.radians(150.0)
"""rad/s at which an ADXRS150 saturates."""
ACCELEROMETER_RANGE = 5.0 * GRAVITY
"""m/s² at which an ADXL105 saturates."""
TICK = 1e-4
"""s between two values of a frame's time."""
BITS_PER_BYTE = 10
"""Start, eight of data, stop."""

_SYNC = b"\xa5\x5a"
_HEAD = struct.Struct("<BHI6h")
_FIX = struct.Struct("<3i")
_CHECK = struct.Struct("<H")
_FULL = 2**15 - 1
_FARTHEST = 2**31 - 1
_MILLI = 1e-3
_SEQUENCE = 2**16


@dataclass(frozen=True, eq=False)
class Reading:
    """What the sensors show at a time.

    **Fields**

    - `time`: s, to 2³² ticks, which is 119 hours. `sequence`: number of the reading, on the line modulo 2¹⁶.
    - `gyro`: (3,) rad/s and `accelerometer`: (3,) m/s², body axes. `fix`: (3,) m, or none.
    """

    time: float
    sequence: int
    gyro: np.ndarray
    accelerometer: np.ndarray
    fix: np.ndarray | None = None

    @property
    def saturated(self) -> np.ndarray:
        """(6,) which of the gyros and accelerometers show no less than their range and may be beyond it."""
        shares = np.concatenate([self.gyro / GYRO_RANGE, self.accelerometer / ACCELEROMETER_RANGE])
        return np.abs(shares) >= 1.0 - 0.5 / _FULL


def encode(reading: Reading) -> bytes:
    """The frame of a reading, each number rounded to its unit, and beyond its range at the end of it.

    **Raises** `InputError` for a time that a frame cannot hold and for a number that is not finite.
    """
    ticks = round(reading.time / TICK) if math.isfinite(reading.time) else -1
    if not 0 <= ticks < 2**32:
        raise InputError("frame", f"time {reading.time} s", f"count from the start, to {2**32 * TICK:.0f} s")
    counts = (*_counts(reading.gyro, GYRO_RANGE / _FULL), *_counts(reading.accelerometer, ACCELEROMETER_RANGE / _FULL))
    body = _HEAD.pack(reading.fix is not None, reading.sequence % _SEQUENCE, ticks, *counts)
    if reading.fix is not None:
        body += _FIX.pack(*_counts(reading.fix, _MILLI, _FARTHEST))
    return _SYNC + body + _CHECK.pack(_checksum(body))


@dataclass
class Decoder:
    """Finds the frames in a stream of bytes, whatever was lost or changed in it.

    After a sync word that no good frame follows it looks for the next from the byte after, so that bytes that only look
    like the start of a frame hide none. They can delay one, by the length of a frame.

    **Fields**

    - `good`: frames found. `bad`: sync words that no good frame followed, one or more for a corrupt frame.
    - `missing`: frames that by the sequence numbers were between good ones; a gap of 2¹⁶ counts as none.
    """

    good: int = 0
    bad: int = 0
    missing: int = 0
    _buffer: bytearray = field(default_factory=bytearray, repr=False)
    _last: int | None = field(default=None, repr=False)

    def feed(self, data: bytes) -> list[Reading]:
        """The readings that `data`, the next bytes of the stream, complete."""
        self._buffer += data
        found = []
        while (reading := self._next()) is not None:
            found.append(reading)
        return found

    def _next(self) -> Reading | None:
        buffer = self._buffer
        while True:
            start = buffer.find(_SYNC)
            # without a sync word only its first byte can be the start of one
            del buffer[: start if start >= 0 else len(buffer) - buffer.endswith(_SYNC[:1])]
            if len(buffer) <= len(_SYNC):
                return None
            kind = buffer[len(_SYNC)]
            end = len(_SYNC) + _HEAD.size + _FIX.size * (kind == 1)
            if kind <= 1 and len(buffer) < end + _CHECK.size:
                return None
            body = bytes(buffer[len(_SYNC) : end])
            if kind <= 1 and _CHECK.unpack_from(buffer, end)[0] == _checksum(body):
                del buffer[: end + _CHECK.size]
                return self._read(body)
            self.bad += 1
            del buffer[0]

    def _read(self, body: bytes) -> Reading:
        kind, sequence, ticks, *counts = _HEAD.unpack_from(body)
        if self._last is not None:
            self.missing += (sequence - self._last - 1) % _SEQUENCE
        self._last = sequence
        self.good += 1
        gyro, accelerometer = np.array(counts[:3]) / _FULL * GYRO_RANGE, np.array(counts[3:]) / _FULL
        fix = np.array(_FIX.unpack_from(body, _HEAD.size)) * _MILLI if kind else None
        return Reading(ticks * TICK, sequence, gyro, accelerometer * ACCELEROMETER_RANGE, fix)


@dataclass
class Line:
    """A serial line that takes time, and now and then a byte or a frame.

    **Fields**

    - `rng`: what decides. `baud`: bit/s.
    - `jitter`: s, the longest that the sender hesitates before a frame, evenly distributed from none.
    - `corruption`: probability that a byte arrives as another. `dropout`: that a frame does not arrive.
    """

    rng: np.random.Generator
    baud: float = 9600.0
    jitter: float = 0.0
    corruption: float = 0.0
    dropout: float = 0.0

    def carry(self, frames: Iterable[tuple[float, bytes]]) -> Iterator[tuple[float, bytes]]:
        """For each frame that arrives, given as (time ready, bytes), the time of its last bit and what arrived.

        A frame waits until the one before is through; one that is dropped takes its time on the line all the same.
        """
        free = -math.inf
        for ready, frame in frames:
            start = max(ready + self.jitter * self.rng.random(), free)
            free = start + BITS_PER_BYTE * len(frame) / self.baud
            if self.rng.random() >= self.dropout:
                yield free, self._corrupted(frame)

    def _corrupted(self, frame: bytes) -> bytes:
        hit = self.rng.random(len(frame)) < self.corruption
        # exclusive or with a byte that is not zero is any other byte
        change = self.rng.integers(1, 256, len(frame), np.uint8)
        return (np.frombuffer(frame, np.uint8) ^ np.where(hit, change, np.uint8(0))).tobytes()


def _counts(values: np.ndarray, unit: float, most: int = _FULL) -> list[int]:
    if not np.all(np.isfinite(values)):
        raise InputError("frame", f"a reading of {values}", "leave out what is not finite")
    return np.clip(np.rint(np.asarray(values) / unit), -most, most).astype(int).tolist()


def _checksum(body: bytes) -> int:
    return binascii.crc_hqx(body, 0xFFFF)
