"""`jaxsub init sensors LOG` writes a sensor file that `navigate` reads, by the names and units of columns."""

import tomllib

import numpy as np
import pytest
from commands import ran

from jaxsub.errors import InputError
from jaxsub.navigation.suite import read_sensors
from jaxsub.navigation.suite.initial import initial_sensors
from jaxsub.recording.logs.log import Channel


def named(*names, unit=""):
    return [Channel(name, unit, 10) for name in names]


def test_a_recordings_columns_become_sensors(tmp_path, monkeypatch, capsys):
    """Claim: gyro, accelerometer, depth, Doppler log and GPS are found by name, and no column twice."""
    header = "t,gyr_x[deg/s],gyr_y[deg/s],gyr_z[deg/s],acc_x,acc_y,acc_z,depth,pressure[dbar],dvl_u,dvl_v,dvl_w,lat,lon"
    rows = "".join(",".join(["%g"] * 14) % (k, *range(13)) + "\n" for k in range(4))
    (tmp_path / "dive.csv").write_text(f"{header}\n{rows}")
    code, said = ran(monkeypatch, capsys, "init", "sensors", tmp_path / "dive.csv", "--out", tmp_path / "s.toml")
    assert code == 0, said.err
    suite = read_sensors(tmp_path / "s.toml")
    kinds = {sensor.kind: sensor.columns for sensor in suite.sensors}
    assert kinds == {
        "gyro": ("gyr_x", "gyr_y", "gyr_z"),
        "accelerometer": ("acc_x", "acc_y", "acc_z"),
        "dvl": ("dvl_u", "dvl_v", "dvl_w"),
        "pressure": ("pressure",),
        "gps": ("lat", "lon"),
    }
    code, said = ran(monkeypatch, capsys, "init", "sensors", tmp_path / "dive.csv")
    assert (code, said.out) == (0, (tmp_path / "s.toml").read_text())


@pytest.mark.parametrize(
    "names",
    [
        [f"sensor_combined.gyro_rad[{i}]" for i in range(3)]
        + [f"sensor_combined.accelerometer_m_s2[{i}]" for i in range(3)],
        [f"/imu.angular_velocity.{i}" for i in "xyz"] + [f"/imu.linear_acceleration.{i}" for i in "xyz"],
        ["p", "q", "r", "ax", "ay", "az"],
    ],
    ids=["px4", "ros", "channels"],
)
def test_names_of_common_logs_are_known(names):
    """Claim: inertial columns of PX4, ROS and recordings are told apart; alone they get a [motion]."""
    data = tomllib.loads(initial_sensors(named(*names), "log"))
    assert data["sensors"]["gyro"]["column"] == names[:3]
    assert data["sensors"]["accelerometer"]["column"] == names[3:]
    assert data["motion"]["reach"] > 0.0


def test_a_log_without_gyros_is_refused():
    """Claim: without three columns like gyros, or with units of something else, the error lists the columns."""
    listed = [*named("ax", "ay", "az"), *named("gyr_x", "gyr_y", "gyr_z", unit="V")]
    with pytest.raises(InputError, match=r"no three columns that look like those of a gyro \(ax, ay, az, gyr_x"):
        initial_sensors(listed, "log")


def test_options_of_vehicles_are_refused(tmp_path, monkeypatch, capsys):
    """Claim: a dimension beside `sensors`, and a log beside a vehicle's kind, are one line and exit 2."""
    for words in (["sensors", tmp_path / "a.csv", "--length", "2"], ["auv", tmp_path / "a.csv"], ["sensors"]):
        code, said = ran(monkeypatch, capsys, "init", *words)
        assert code == 2 and said.err.count("\n") == 1, said.err
        assert not np.any([path.exists() for path in tmp_path.iterdir()])
