"""A magnetometer's delay and hard iron follow from the gyros, with standard errors that hold."""

import dataclasses

import numpy as np
from scipy.spatial.transform import Rotation
from test_sensor_files import suite_of

from jaxsub.navigation.field import with_field
from jaxsub.navigation.suite.log import sensor_log
from jaxsub.recording import Recording

TEXT = """
schema = 1
[sensors.gyro]
column = ["gx", "gy", "gz"]
[sensors.accelerometer]
column = ["ax", "ay", "az"]
[sensors.magnetometer]
column = ["mx", "my", "mz"]
unit = "uT"
delay = "estimate"
calibration = "hard-iron"
"""
PHASES = np.array([0.0, 1.0, 2.0])
IRON, LATE = np.array([4.0, -6.0, 3.0]), 0.032


def turning(seed, size):
    """A log of 60 s of a board that is turned to and fro by `size` rad, its gyros biased and its field disturbed."""
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(6000)
    rates = np.array([1.3, 1.9, 0.7])
    attitude = lambda at: Rotation.from_euler("ZYX", size * np.sin(np.outer(at, rates) + PHASES))
    step = 1e-4
    gyro = (attitude(t - step).inv() * attitude(t + step)).as_rotvec() / (2.0 * step)
    field = attitude(t - LATE).inv().apply([20.0, 0.0, 44.0]) + IRON + 0.5 * rng.normal(size=(6000, 3))
    still = np.tile([0.0, 0.0, -9.8], (6000, 1))
    parts = {"g": gyro + np.array([0.01, -0.02, 0.005]), "a": still, "m": field}
    columns = {f"{name}{axis}": part[:, i] for name, part in parts.items() for i, axis in enumerate("xyz")}
    return sensor_log(Recording("board", t, columns, "board"), suite_of(TEXT))


def test_delay_and_hard_iron_are_found_and_taken_off():
    """Claim: over eight logs both lie within four standard errors of the truth, in rms between 0.4 and 1.7 of them."""
    ratios = []
    for seed in range(8):
        log, suite, fit = with_field(turning(seed, 0.8), suite_of(TEXT))
        ratios.append([(fit.delay - LATE) / fit.delay_std, *((1e6 * fit.hard_iron - IRON) / (1e6 * fit.hard_iron_std))])
        assert fit.delayed and fit.corrected == "hard-iron" and fit.after < 0.3 * fit.before
        assert suite.only("magnetometer").delay == fit.delay and suite.only("magnetometer").delay_std == 0.0
        strength = np.linalg.norm(log.readings["magnetometer"], axis=1)
        assert strength.std() / strength.mean() < 0.02
    ratios = np.array(ratios)
    assert (np.abs(ratios) < 4.0).all(), ratios
    assert 0.4 < np.sqrt(np.mean(ratios**2)) < 1.7, np.sqrt(np.mean(ratios**2, axis=0))


def test_what_the_motion_does_not_show_is_left():
    """Claim: of a board that hardly turns neither is taken off, and two warnings say how well they are known."""
    before = turning(1, 0.001)
    log, suite, fit = with_field(before, suite_of(TEXT))
    assert not fit.delayed and fit.corrected == "none"
    assert [finding.check for finding in log.findings] == ["magnetometer", "magnetometer"]
    np.testing.assert_array_equal(log.readings["magnetometer"], before.readings["magnetometer"])
    assert suite.only("magnetometer") == dataclasses.replace(suite_of(TEXT).only("magnetometer"), delay_std=0.0)


def test_soft_iron_and_misaligned_axes_are_found_and_taken_off():
    """Claim: over four logs they lie within four standard errors, and calibrated readings turn as the field does."""
    D = np.array([[0.02, 0.03, -0.02], [-0.01, -0.03, 0.01], [0.02, 0.04, 0.01]])
    text = TEXT.replace("hard-iron", "soft-iron")
    for seed in range(4):
        log = turning(seed, 0.8)
        seen = log.readings["magnetometer"] @ np.linalg.inv(np.eye(3) + D).T
        log = dataclasses.replace(log, readings=log.readings | {"magnetometer": seen})
        after, _, fit = with_field(log, suite_of(text))
        assert fit.corrected == "soft-iron" and fit.after < 0.5 * fit.before
        ratio = (fit.soft_iron - np.eye(3) - D) / fit.soft_iron_std
        assert (np.abs(ratio) < 4.0).all(), ratio
        still = turning(seed, 0.8).readings["magnetometer"] - 1e-6 * IRON
        assert np.abs(after.readings["magnetometer"] - still).max() < 2e-6
