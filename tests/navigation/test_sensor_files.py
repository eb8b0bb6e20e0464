"""A sensor file is read as the guide says, and what is wrong with one is one line that says where and what to do."""

import tomllib

import numpy as np
import pytest
from navigate_cases import SENSORS
from scipy.spatial.transform import Rotation

from jaxsub.errors import InputError
from jaxsub.navigation.suite import GRADES, sensors_from
from jaxsub.navigation.suite.log import sensor_log
from jaxsub.recording import Recording

TEXT = SENSORS.format(rule="constant", more="")
WRONG = [
    ("schema = 1", "schema = 2", "sensors.toml: schema: is 2; this version reads schema = 1"),
    ('rule = "constant"', 'rule = "fuzy"', "did you mean fuzzy?"),
    ("sigma = 0.02", "sigmma = 0.02", "sensors.dvl.sigmma: unknown key; did you mean sigma?"),
    ("sigma = 0.02", "sigma = -0.02", "sensors.dvl.sigma: is -0.02; give a positive number"),
    ("sigma = 0.02", "sigma = [0.02, 0.02]", "sensors.dvl.sigma: has 2 entries"),
    ("sigma = 0.02", 'delay = "guess"', "sensors.dvl.delay"),
    ("sigma = 0.02", "beacon = [0.0, 0.0, 0.0]", "sensors.dvl.beacon: unknown key"),
    ('unit = "deg/s"', 'unit = "deg"', "sensors.gyro.unit: is 'deg', and the sensor measures rad/s"),
    ('unit = "deg/s"', 'unit = "dgr/s"', "unknown unit"),
    ('frame = "FLU"', 'frame = "ENU"', "sensors.gyro.frame"),
    ('["y", "-x", "z"]', '["y", "x", "z"]', "is no rotation"),
    ('["y", "-x", "z"]', '["y", "q", "z"]', "give the angles of roll, pitch and yaw in rad"),
    ('["gx", "gy", "gz"]', '["gx", "gy"]', "sensors.gyro.column: has 2 entries; give 3"),
    ('["gx", "gy", "gz"]', '["gx", "gy", "fz"]', "is a column of gyro too"),
    ("[sensors.usbl]", "[sensors.sonar]", "sensors.sonar.kind: is missing"),
    ("[sensors.gyro]", "[sensors.magnetometer2]", "kind"),
    ('grade = "consumer"', 'grade = "cheap"', "sensors.gyro.grade"),
    ("density = 1025.0", "density = 1025.0\nlatitude = 0.5", "is given beside density"),
    ("density = 1025.0", "density = 1e5", "give the water's density"),
]


def suite_of(text):
    return sensors_from(tomllib.loads(text), "sensors.toml")


@pytest.mark.parametrize(("old", "new", "said"), WRONG, ids=[new for _, new, _ in WRONG])
def test_what_is_wrong_is_one_line(old, new, said):
    """Claim: each mistake raises an error of one line that names the key and what to write instead."""
    assert old in TEXT
    with pytest.raises(InputError) as error:
        suite_of(TEXT.replace(old, new, 1))
    assert said in str(error.value) and "\n" not in str(error.value)


def test_a_suite_without_a_gyro_is_refused():
    """Claim: gyro and accelerometer are needed, and the error says how to give them."""
    with pytest.raises(InputError, match=r"has 0 sensors of the kind gyro"):
        suite_of("schema = 1\n[sensors.accelerometer]\ncolumn = ['a', 'b', 'c']\n")


def test_keys_mean_what_they_say():
    """Claim: grades, single numbers over them, delays, mountings by angles and by axes are as written."""
    suite = suite_of(
        """
schema = 1
[motion]
reach = 0.5
[sensors.gyro]
column = ["a", "b", "c"]
grade = "industrial"
density = 3e-4
mounting = [0.1, -0.2, 0.3]
[sensors.accelerometer]
column = ["d", "e", "f"]
[sensors.pinger]
kind = "range"
column = "g"
beacon = [1.0, 2.0, 3.0]
delay = { value = 0.2, prior_std = 0.05 }
"""
    )
    gyro, pinger = suite.only("gyro"), suite.of("range")[0]
    assert gyro.noise == GRADES["gyro"]["industrial"]._replace(density=3e-4)
    np.testing.assert_allclose(gyro.mounting, Rotation.from_euler("ZYX", [0.3, -0.2, 0.1]).as_matrix(), atol=1e-15)
    assert (pinger.delay, pinger.delay_std, pinger.beacon) == (0.2, 0.05, (1.0, 2.0, 3.0))
    assert suite.only("accelerometer").noise == GRADES["accelerometer"]["consumer"]
    assert suite.motion.reach == 0.5 and suite.rule == "constant"


def readings(text, columns, units=()):
    count = len(next(iter(columns.values())))
    times = 0.1 * np.arange(count)
    needed = {name: np.arange(float(count)) for name in "abcdef"}
    run = Recording("run", times, needed | columns, "run.csv", units=dict(units))
    whole = "schema = 1\n[sensors.gyro]\ncolumn=['a','b','c']\n[sensors.accelerometer]\ncolumn=['d','e','f']\n" + text
    return sensor_log(run, suite_of(whole))


def test_fixes_are_metres_north_and_east_of_the_first():
    """Claim: 10⁻⁵ rad of latitude and longitude at 45° are 63.7 m and 45.2 m, and altitude is minus z."""
    text = (
        "[sensors.gps]\ncolumn = ['lat', 'lon', 'alt']\nchannel = ['latitude', 'longitude', 'altitude']\n"
        "unit = ['deg', 'deg', 'm']\n"
    )
    lat, lon = (np.degrees(start + 1e-5 * np.arange(3.0)) for start in (np.pi / 4.0, 0.2))
    log = readings(text, {"lat": lat, "lon": lon, "alt": np.array([0.0, 5.0, 10.0])})
    np.testing.assert_allclose(log.readings["gps"][1], [63.67, 45.18, -5.0], atol=0.05)
    np.testing.assert_allclose(log.origin, [np.pi / 4.0, 0.2])


def test_a_unit_that_the_file_states_counts_and_another_dimension_is_refused():
    """Claim: values of a column with a unit are in SI already, and `m` is no unit of a pressure."""
    text = "[sensors.pressure]\ncolumn = 'p'\nunit = 'dbar'\ndensity = 1000.0\noffset = 1e5\n"
    log = readings(text, {"p": np.array([1e5, 1.1e5])}, {"p": "Pa"})
    np.testing.assert_allclose(log.readings["pressure"][:, 0], [0.0, 1e4 / 9806.65], rtol=1e-12)
    other = readings(text, {"p": np.array([10.0, 11.0])})
    np.testing.assert_allclose(other.readings["pressure"], log.readings["pressure"])
    with pytest.raises(InputError, match="the sensor measures Pa"):
        readings(text, {"p": np.array([1.0, 2.0])}, {"p": "m"})


def test_a_value_that_is_held_between_measurements_counts_once():
    """Claim: of 4 values held for 5 rows each, 4 remain, and a note counts the other 16."""
    log = readings("[sensors.depth]\ncolumn = 'z'\n", {"z": np.repeat([1.0, 2.0, 1.5, 3.0], 5)})
    assert np.isfinite(log.readings["depth"]).sum() == 4
    assert [finding.count for finding in log.findings if finding.check == "held-samples"] == [16]
