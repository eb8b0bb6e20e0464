"""Small ArduPilot logs: dataflash assembled from its published layout, telemetry packed by pymavlink's writing side."""

import struct
from pathlib import Path

import numpy as np

TIMES = 5.0 + 0.02 * np.arange(50)  # s since boot
RATE = 0.3 * np.sin(TIMES)
HEADING = (350.0 + 20.0 * (TIMES - 5.0)) % 360.0  # deg, passes through north
PWM = 1500 + 10 * np.arange(50)

_SIZES = {
    "Q": "Q",
    "f": "f",
    "d": "d",
    "B": "B",
    "b": "b",
    "n": "4s",
    "N": "16s",
    "Z": "64s",
    "H": "H",
    "c": "h",
    "C": "H",
}


def _body(form: str, values) -> bytes:
    packed = [value.encode() if isinstance(value, str) else value for value in values]
    return struct.pack("<" + "".join(_SIZES[c] for c in form), *packed)


def dataflash(path: Path) -> Path:
    formats = {
        "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
        "UNIT": (129, "QbZ", "TimeUS,Id,Label"),
        "MULT": (130, "Qbd", "TimeUS,Id,Mult"),
        "FMTU": (131, "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        "ATT": (132, "QC", "TimeUS,Yaw"),
        "IMU": (133, "QBf", "TimeUS,I,GyrZ"),
        "RCOU": (134, "QH", "TimeUS,C1"),
    }
    message = lambda kind, values: b"\xa3\x95" + bytes([formats[kind][0]]) + _body(formats[kind][1], values)
    length = lambda form: 3 + struct.calcsize("<" + "".join(_SIZES[c] for c in form))
    out = b"".join(message("FMT", (k, length(f), name, f, c)) for name, (k, f, c) in formats.items())
    out += b"".join(
        message("UNIT", (1, ord(i), u)) for i, u in {"s": "s", "h": "degheading", "E": "rad/s", "#": "instance"}.items()
    )
    out += b"".join(message("MULT", (1, ord(i), m)) for i, m in {"F": 1e-6, "-": 0.0, "0": 1.0, "B": 1e-2}.items())
    out += message("FMTU", (1, 132, "sh", "FB")) + message("FMTU", (1, 133, "s#E", "F-0"))
    for t, r, psi, pwm in zip(TIMES, RATE, HEADING, PWM, strict=True):
        micro = round(t * 1e6)
        out += message("IMU", (micro, 0, r)) + message("IMU", (micro, 1, r + 1.0))
        out += message("ATT", (micro, round(100 * psi))) + message("RCOU", (micro, int(pwm)))
    path.write_bytes(out)
    return path


def telemetry(path: Path) -> Path:
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    sender = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    ground = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    out = b""
    for t, r, psi in zip(TIMES, RATE, HEADING, strict=True):
        stamp = struct.pack(">Q", round(1.7e15 + t * 1e6))
        yaw = np.deg2rad(psi) - (2 * np.pi if psi > 180 else 0)
        out += stamp + sender.attitude_encode(round(t * 1e3), 0, 0, float(yaw), 0, 0, float(r)).pack(sender)
        out += stamp + sender.heartbeat_encode(12, 3, 0, 0, 0).pack(sender)
        out += stamp + ground.heartbeat_encode(6, 8, 0, 0, 0).pack(ground)
    path.write_bytes(out)
    return path
