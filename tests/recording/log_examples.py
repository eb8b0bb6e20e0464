"""Logs of one short flight, written by the writing sides of the packages that read them."""

import json
import struct
from pathlib import Path

import numpy as np

RATE_TIMES = 10.0 + 0.02 * np.arange(100)  # gyro, 50 Hz, s on the log's clock
ANGLE_TIMES = 10.005 + 0.1 * np.arange(20)  # attitude, 10 Hz
FIN_TIMES = np.array([10.1, 10.5, 11.0, 11.5])  # commands, when they change
YAW_RATE = 0.3 * np.sin(RATE_TIMES)
YAW = 3.0 + 0.5 * (ANGLE_TIMES - 10.0)  # passes half a turn
PITCH = 0.1 * np.cos(ANGLE_TIMES)
FIN = np.array([0.0, 1.0, -1.0, 0.5])


def quaternions():
    """(20, 4) of yaw then pitch, scalar first."""
    half = 0.5 * np.stack([YAW, PITCH])
    (cy, cp), (sy, sp) = np.cos(half), np.sin(half)
    return np.stack([cy * cp, -sy * sp, cy * sp, sy * cp], axis=1)


def ulog(path: Path) -> Path:
    """Assembled from ULog's published layout, so that nothing of the reader is trusted in the writing."""
    formats = {
        "vehicle_angular_velocity": "uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz",
        "vehicle_attitude": "uint64_t timestamp;float[4] q",
        "actuator_servos": "uint64_t timestamp;float[2] control",
    }
    message = lambda kind, body: struct.pack("<HB", len(body), ord(kind)) + body
    micro = lambda t: round(t * 1e6)
    out = b"\x55\x4c\x6f\x67\x01\x12\x35\x01" + struct.pack("<Q", micro(10.0)) + message("B", bytes(40))
    out += b"".join(message("F", f"{name}:{fields};".encode()) for name, fields in formats.items())
    subscribed = [*enumerate(formats), (3, "actuator_servos")]
    for number, name in subscribed:
        out += message("A", struct.pack("<BH", number == 3, number) + name.encode())
    rows = [
        (t + 0.003, 0, struct.pack("<QQ3f", micro(t + 0.003), micro(t), 0, 0, r))
        for t, r in zip(RATE_TIMES, YAW_RATE, strict=True)
    ]
    rows += [(t, 1, struct.pack("<Q4f", micro(t), *q)) for t, q in zip(ANGLE_TIMES, quaternions(), strict=True)]
    rows += [(t, 2, struct.pack("<Q2f", micro(t), 0, f)) for t, f in zip(FIN_TIMES, FIN, strict=True)]
    rows += [(t, 3, struct.pack("<Q2f", micro(t), 7, 8)) for t in FIN_TIMES]
    out += b"".join(message("D", struct.pack("<H", number) + body) for _, number, body in sorted(rows))
    path.write_bytes(out)
    return path


def mcap_json(path: Path) -> Path:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1000)  # several chunks
        writer.start()
        schema = writer.register_schema("any", "jsonschema", b"{}")
        topics = {
            "gyro": [
                (t, {"w": [0.0, 0.0, r], "name": "imu", "ok": True}) for t, r in zip(RATE_TIMES, YAW_RATE, strict=True)
            ],
            "fin": [(t, {"angle": f}) for t, f in zip(FIN_TIMES, FIN, strict=True)],
        }
        keys = {topic: writer.register_channel(topic, "json", schema) for topic in topics}
        for t, topic, row in sorted((t, topic, row) for topic, rows in topics.items() for t, row in rows):
            now = round(t * 1e9)
            writer.add_message(keys[topic], now, json.dumps(row).encode(), now)
        writer.finish()
    return path


def _ros_rows(store):
    """Topic, type, time of receipt and message of each message of the flight; an IMU's frame looks left and up."""
    kind = store.types
    stamp = lambda t: kind["builtin_interfaces/msg/Time"](sec=int(t), nanosec=round((t % 1) * 1e9))
    extra = {"seq": 0} if "seq" in kind["std_msgs/msg/Header"].__dataclass_fields__ else {}
    header = lambda t: kind["std_msgs/msg/Header"](stamp=stamp(t), frame_id="imu", **extra)
    vector = lambda *v: kind["geometry_msgs/msg/Vector3"](**dict(zip("xyz", v, strict=True)))
    nothing = np.zeros(9)
    for t, r in zip(RATE_TIMES, YAW_RATE, strict=True):
        turned = kind["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0)
        imu = kind["sensor_msgs/msg/Imu"](
            header=header(t), orientation=turned, orientation_covariance=nothing,
            angular_velocity=vector(0.0, 0.0, -float(r)), angular_velocity_covariance=nothing,
            linear_acceleration=vector(0.0, 0.0, 9.8), linear_acceleration_covariance=nothing,
        )  # fmt: skip
        yield "/imu", "sensor_msgs/msg/Imu", t + 0.004, imu
    for t, f in zip(FIN_TIMES, FIN, strict=True):
        yield "/fin", "std_msgs/msg/Float64", t, kind["std_msgs/msg/Float64"](data=float(f))


def rosbag1(path: Path) -> Path:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        keys = {}
        for topic, kind, t, message in _ros_rows(store):
            keys[topic] = keys.get(topic) or writer.add_connection(topic, kind, typestore=store)
            writer.write(keys[topic], round(t * 1e9), store.serialize_ros1(message, kind))
    return path


def rosbag2(path: Path, storage: str = "SQLITE3") -> Path:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        keys = {}
        for topic, kind, t, message in _ros_rows(store):
            keys[topic] = keys.get(topic) or writer.add_connection(topic, kind, typestore=store)
            writer.write(keys[topic], round(t * 1e9), store.serialize_cdr(message, kind))
    return path
