"""Fixes alone show the attitude at the start of a motion, with biases, and how well they show it."""

from typing import Any

import numpy as np
import pytest
from navigate_cases import GRAVITY, SENSORS, columns
from scipy.spatial.transform import Rotation
from test_sensor_files import suite_of

from jaxsub.errors import InputError
from jaxsub.navigation.fix_alignment import aligned_by_fixes
from jaxsub.navigation.start import start_of
from jaxsub.navigation.suite.log import sensor_log
from jaxsub.recording import Recording

TIMES = 0.02 * np.arange(2000)
ANY = np.array([1.0, 0.0, 0.0, 0.0])
INERTIAL = """
[sensors.gyro]
column = ["gx", "gy", "gz"]
grade = "consumer"
[sensors.accelerometer]
column = ["fx", "fy", "fz"]
grade = "consumer"
"""


def turned(seed):
    """The known motion with its track turned by a random heading: log, true attitude and velocity at the start."""
    heading = np.random.default_rng(seed).uniform(-np.pi, np.pi)
    truth, log = columns(seed, TIMES)
    by = Rotation.from_rotvec([0.0, 0.0, heading])
    log["north"], log["east"], _ = by.apply(np.stack([log["north"], log["east"], 0.0 * TIMES], axis=1)).T
    return log, by * truth.R[0], by.apply(truth.velocity[0])


def found_of(log, text) -> Any:
    suite = suite_of(text)
    made = sensor_log(Recording("dive", TIMES[: len(log["gx"])], log, "dive"), suite)
    return aligned_by_fixes(made, suite, ANY, np.zeros(3), np.radians(1.0))


def test_errors_are_of_the_size_stated():
    """Claim: of ten runs attitude errors over their deviations have an rms of 0.5 to 1.6."""
    ratios = []
    for seed in range(10):
        log, attitude, velocity = turned(seed)
        found = found_of(log, SENSORS.format(rule="constant", more=""))
        apart = (attitude * Rotation.from_quat(np.roll(found.q, -1)).inv()).as_rotvec()
        assert found.std[2] < 0.3
        assert np.linalg.norm(found.velocity - velocity) < 1.0
        ratios.append(apart / found.std[:3])
    rms = np.sqrt(np.mean(np.square(ratios), axis=0))
    assert (rms > 0.5).all() and (rms < 1.6).all(), rms


def leaving(seconds, heading) -> Any:
    """At rest for some seconds, then three accelerations in turn; nothing turns. `fixes` of position and velocity."""
    attitude = Rotation.from_euler("ZYX", [heading, 0.2, -0.1])
    pushes = np.array([[0.5, 0.0, 0.0], [-0.5, 0.8, 0.1], [0.0, -0.8, -0.1]])
    acceleration = np.zeros((len(TIMES), 3))
    for k, push in enumerate(pushes):
        begin = seconds + 4.0 * k
        acceleration[(begin <= TIMES) & (begin + 4.0 > TIMES)] = push
    dt = TIMES[1]
    velocity = np.cumsum(acceleration, axis=0) * dt
    position = np.cumsum(velocity, axis=0) * dt
    force = attitude.inv().apply(acceleration - GRAVITY)
    log = dict(zip(("fx", "fy", "fz"), force.T, strict=True)) | dict.fromkeys(("gx", "gy", "gz"), 0.0 * TIMES)
    off = np.random.default_rng(5).normal(size=(len(TIMES), 6)) * np.repeat([0.3, 0.05], 3)
    once = np.where((np.arange(len(TIMES)) % 50 == 0)[:, None], np.hstack([position, velocity]) + off, np.nan)
    return log | dict(zip(("x", "y", "z", "vx", "vy", "vz"), once.T, strict=True)), heading


FIXES = {
    "three axes": '[sensors.gps]\ncolumn = ["x", "y", "z"]\nchannel = ["x", "y", "z"]\nsigma = 0.3',
    "two axes": '[sensors.usbl]\ncolumn = ["x", "y"]\nsigma = 0.3',
    "velocity": '[sensors.velocity]\ncolumn = ["vx", "vy", "vz"]\nsigma = 0.05',
}


@pytest.mark.parametrize("fixes", FIXES.values(), ids=FIXES)
@pytest.mark.parametrize("rest", [0.0, 15.0])
def test_the_window_reaches_to_the_motion_that_shows_the_heading(fixes, rest):
    """Claim: within three deviations, also where the vehicle waits for longer than the first windows."""
    log, heading = leaving(rest, 2.5)
    found = found_of(log, "schema = 1\n" + INERTIAL + fixes)
    assert found.shows_heading
    yaw = Rotation.from_quat(np.roll(found.q, -1)).as_euler("ZYX")[0]
    assert abs((yaw - heading + np.pi) % (2.0 * np.pi) - np.pi) < 3.0 * found.std[2]


def test_a_vehicle_that_waits_shows_no_heading_and_says_so():
    """Claim: at rest throughout, tilt is found and yaw is not; with fewer than four fixes there is no answer."""
    log, _ = leaving(100.0, 2.5)
    text = "schema = 1\n" + INERTIAL + FIXES["three axes"]
    found = found_of(log, text)
    assert not found.shows_heading and found.std[2] > 1.0 and found.std[:2].max() < 0.1
    suite = suite_of(text)
    start = start_of(sensor_log(Recording("dive", TIMES, log, "dive"), suite), suite)
    assert start.rest and start.heading == "unknown" and start.std[2] > 1.0
    few = {name: values[:150] for name, values in log.items()}
    assert found_of(few, text) is None


def test_columns_that_may_be_degrees_or_metres_are_refused():
    """Claim: three columns of a GPS without a word are not taken for latitude, longitude and altitude."""
    text = "schema = 1\n" + INERTIAL + '[sensors.gps]\ncolumn = ["x", "y", "z"]\n'
    with pytest.raises(InputError, match=r"sensors.gps.channel: is missing, and 3 columns may be .*altitude\] or \[x"):
        suite_of(text)
