"""Installed orientation filters on a recording of gyros, accelerometers and magnetometer, where they are installed."""

import importlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

_ENU = Rotation.identity()
_FROM_NWU = Rotation.from_matrix([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_FROM_NED = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


class Readings(NamedTuple):
    """(K, 3) readings, rad/s, m/s², µT, one every `interval` s, and the field's dip, rad."""

    gyro: np.ndarray
    accelerometer: np.ndarray
    magnetometer: np.ndarray
    interval: float
    dip: float


def peers(readings: Readings, packages: Sequence[str]) -> Iterator[tuple[str, np.ndarray]]:
    """Name and (K, 4) attitudes, body to ENU, of the filters of `packages` that are there, with their own defaults."""
    for package in packages:
        try:
            module = importlib.import_module(package)
        except ImportError:
            continue
        for name, (frame, run) in {"vqf": _vqf, "ahrs": _ahrs}[package](module, readings).items():
            turned = frame * Rotation.from_quat(np.asarray(run()), scalar_first=True)
            yield name, turned.as_quat(scalar_first=True)


def _vqf(vqf: Any, readings: Readings) -> dict[str, tuple[Rotation, Callable[[], np.ndarray]]]:
    gyro, accelerometer, magnetometer = (np.ascontiguousarray(part) for part in readings[:3])
    on_line = lambda: vqf.VQF(readings.interval).updateBatch(gyro, accelerometer, magnetometer)["quat9D"]
    off_line = lambda: vqf.offlineVQF(gyro, accelerometer, magnetometer, readings.interval)["quat9D"]
    return {"vqf": (_ENU, on_line), "vqf_offline": (_ENU, off_line)}


def _ahrs(ahrs: Any, readings: Readings) -> dict[str, tuple[Rotation, Callable[[], np.ndarray]]]:
    rate, (gyro, accelerometer, magnetometer) = 1.0 / readings.interval, readings[:3]
    madgwick = lambda: ahrs.filters.Madgwick(gyr=gyro, acc=accelerometer, mag=magnetometer, frequency=rate).Q
    mahony = lambda: ahrs.filters.Mahony(gyr=gyro, acc=accelerometer, mag=magnetometer, frequency=rate).Q
    # its north, east, down frame takes gravity itself, not what an accelerometer shows
    gravity, dip = -accelerometer, float(np.degrees(readings.dip))
    ekf = lambda: ahrs.filters.EKF(gyr=gyro, acc=gravity, mag=magnetometer, frequency=rate, magnetic_ref=dip).Q
    return {"ahrs_madgwick": (_FROM_NWU, madgwick), "ahrs_mahony": (_ENU, mahony), "ahrs_ekf": (_FROM_NED, ekf)}
