"""A small recording in every kind of file, to be damaged."""

import zipfile
from pathlib import Path

import ardupilot_examples
import h5py
import log_examples
import numpy as np
import pandas
import scipy.io
import xarray

from jaxsub.recording import Recording, save

T, U = 0.25 * np.arange(12), np.linspace(-1.0, 2.0, 12)
COLUMNS = {
    "ulg": {"r": "vehicle_angular_velocity.xyz[2]", "d": "actuator_servos.control[1]"},
    "mcap": {"r": "gyro.w[2]", "d": "fin.angle"},
    "bag": {"r": "/imu.angular_velocity.z", "d": "/fin.data"},
    "bin": {"r": "IMU[0].GyrZ", "psi": "ATT.Yaw"},
    "tlog": {"r": "ATTITUDE.yawspeed"},
}


def _matlab_73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["t"], file["u"] = T[None], U[None]
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    path.write_bytes(head + path.read_bytes()[len(head) :])


def _zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("run.csv", "t,u\n" + "".join(f"{t},{u}\n" for t, u in zip(T, U, strict=True)))


def _classic(path: Path) -> None:
    xarray.Dataset({"u": ("t", U)}, {"t": T}).to_netcdf(path, engine="scipy", format="NETCDF3_CLASSIC")


WRITERS = {
    "parquet": lambda path: save(Recording("run", T, {"u": U}, "memory"), path, {"u": "knot"}),
    "nc": lambda path: save(Recording("run", T, {"u": U}, "memory"), path, {"u": "knot"}),
    "classic.nc": _classic,
    "mat": lambda path: scipy.io.savemat(path, {"s": {"t": T, "u": U, "c": np.array([1, "x"], object)}}),
    "packed.mat": lambda path: scipy.io.savemat(path, {"t": T, "u": U}, do_compression=True),
    "73.mat": _matlab_73,
    "xlsx": lambda path: pandas.DataFrame({"t": T, "u": U}).to_excel(path, index=False),
    "zip": _zip,
    "ulg": log_examples.ulog,
    "mcap": log_examples.mcap_json,
    "bag": log_examples.rosbag1,
    "bin": ardupilot_examples.dataflash,
    "tlog": ardupilot_examples.telemetry,
}
