"""Logs written by other code load as the flight they hold: each sample at its own time, turned and scaled as asked."""

import log_examples as flight
import numpy as np
import pytest

from jaxsub.errors import InputError
from jaxsub.recording import Selection, contents, load, load_log

# what of each kind of log is the yaw rate, and the fin's angle out of ±25°
ULG = {"r": "vehicle_angular_velocity.xyz[2]", "delta_r[deg]": "25 * actuator_servos.control[1]"}
JSON = {"r": "gyro.w[2]", "delta_r[deg]": "25 * fin.angle"}
ROS = {"r": "-/imu.angular_velocity.z", "delta_r[deg]": "25 * /fin.data"}


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    for package in ("pyulog", "mcap", "rosbags"):
        pytest.importorskip(package)
    folder = tmp_path_factory.mktemp("logs")
    bag = flight.rosbag2(folder / "bag2")
    return {
        "ulg": (flight.ulog(folder / "flight.ulg"), ULG),
        "mcap, JSON": (flight.mcap_json(folder / "flight.mcap"), JSON),
        "bag": (flight.rosbag1(folder / "flight.bag"), ROS),
        "bag 2": (bag, ROS),
        "db3": (next(bag.glob("*.db3")), ROS),
        "mcap, ROS 2": (next(flight.rosbag2(folder / "bag3", "MCAP").glob("*.mcap")), ROS),
    }


KINDS = ["ulg", "mcap, JSON", "bag", "bag 2", "db3", "mcap, ROS 2"]


@pytest.mark.parametrize("kind", KINDS)
def test_flight_comes_out_of_every_kind_of_log(logs, kind):
    path, columns = logs[kind]
    run = load(path, columns, held=["delta_r"])
    rows = np.unique(np.round(np.concatenate([flight.RATE_TIMES, flight.FIN_TIMES]), 6))
    rows = rows[rows >= flight.FIN_TIMES[0]] - 10.0
    np.testing.assert_allclose(run.times, rows, atol=1e-6)
    measured = ~np.isnan(run.column("r"))
    expected = 0.3 * np.sin(10.0 + run.times[measured])
    assert measured.sum() == (flight.FIN_TIMES[0] - 1e-9 <= flight.RATE_TIMES).sum()
    np.testing.assert_allclose(run.column("r")[measured], expected, atol=1e-6)
    last = np.searchsorted(flight.FIN_TIMES - 10.0 - 1e-6, run.times, side="right") - 1
    np.testing.assert_allclose(run.column("delta_r"), np.deg2rad(25.0) * flight.FIN[last], atol=1e-7)
    assert run.inputs(["delta_r"]).shape == (len(run.times), 1)


@pytest.mark.parametrize("kind", KINDS)
def test_contents_name_what_can_be_asked_for(logs, kind):
    path, columns = logs[kind]
    listed = {channel.name: channel.samples for channel in contents(path).channels}
    for term in (Selection(columns).term(header) for header in columns):
        assert listed[term.channel] == (
            4 if "delta" in term.channel or "fin" in term.channel or "servo" in term.channel else 100
        )


def test_attitude_comes_from_a_quaternion_without_a_jump(logs):
    path, _ = logs["ulg"]
    columns = {
        "psi": "yaw(vehicle_attitude.q)",
        "theta": "pitch(vehicle_attitude.q)",
        "phi": "roll(vehicle_attitude.q)",
    }
    run = load_log(path, columns)
    np.testing.assert_allclose(run.column("psi"), flight.YAW, atol=1e-5)
    np.testing.assert_allclose(run.column("theta"), flight.PITCH, atol=1e-6)
    np.testing.assert_allclose(run.column("phi"), 0.0, atol=1e-6)


def test_second_instance_of_a_topic_is_a_channel_of_its_own(logs):
    run = load_log(logs["ulg"][0], {"x": "actuator_servos[1].control[0]"})
    np.testing.assert_array_equal(run.column("x"), 7.0)


def test_rows_at_a_given_distance_hold_the_nearest_samples(logs):
    path, columns = logs["ulg"]
    run = load_log(path, Selection(columns, every=0.05, start=0.5, end=1.5), held=["delta_r"])
    np.testing.assert_allclose(run.times, np.arange(0.5, 1.501, 0.05), atol=1e-9)
    nearest = [flight.YAW_RATE[np.argmin(np.abs(flight.RATE_TIMES - 10.0 - t))] for t in run.times]
    assert np.max(np.abs(run.column("r") - nearest)) < 0.3 * 0.02  # a tie goes to either
    assert not np.isnan(run.column("r")).any()


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (None, "is a log of many channels; say which to take by --columns"),
        ({"r": "vehicle_angular_velocity.xzy[2]"}, r"no channel .* did you mean 'vehicle_angular_velocity.xyz\[2\]'"),
        ({"r": "spin(vehicle_attitude.q)"}, r"holds no channel 'spin\(vehicle"),
        ({"phi": "roll(vehicle_angular_velocity.xyz)"}, "holds no quaternion"),
        ({"r": "a + b"}, "column 'r': 'a \\+ b' takes a and b"),
        ({"r[dge/s]": "vehicle_angular_velocity.xyz[2]"}, r"column 'r\[dge/s\]': unknown unit 'dge/s'"),
        ({"t": "vehicle_angular_velocity.xyz[2]"}, "a log brings its own times"),
        ({}, "names no column"),
    ],
)
def test_bad_choice_is_one_error(logs, columns, message):
    with pytest.raises(InputError, match=message):
        load(logs["ulg"][0], columns)


def test_channels_on_clocks_that_never_meet_are_refused(logs):
    from jaxsub.recording.logs import Series, merged

    apart = {"r": Series(np.arange(3.0), np.zeros(3)), "d": Series(1e9 + np.arange(3.0), np.zeros(3))}
    with pytest.raises(InputError, match=r"no time in common .* see whether clocks differ"):
        merged(apart, "run", "log", held=["d"], end=100.0)


@pytest.mark.parametrize("suffix", [".ulg", ".mcap", ".bag", ".db3", ".dbd"])
def test_damaged_log_is_one_error(tmp_path, suffix):
    path = tmp_path / f"flight{suffix}"
    path.write_bytes(b"nonsense" * 20)
    with pytest.raises(InputError, match=r"cannot be read|does not begin like"):
        contents(path)


def test_missing_reader_says_what_installs_it(tmp_path, monkeypatch):
    import sys

    (tmp_path / "flight.ulg").write_bytes(b"ULog")
    monkeypatch.setitem(sys.modules, "pyulog", None)
    with pytest.raises(InputError, match=r"needs the package pyulog, .* pip install 'jaxsub\[logs\]'"):
        contents(tmp_path / "flight.ulg")
