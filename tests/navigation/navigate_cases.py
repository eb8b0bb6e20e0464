"""A vehicle whose motion is known in closed form, and what its raw sensors show of it; nothing of jaxsub made it."""

import numpy as np
from scipy.spatial.transform import Rotation

GRAVITY = np.array([0.0, 0.0, 9.80665])
FIELD = np.array([20e-6, 0.0, 44e-6])  # T, NED
SENSORS = """
schema = 1
name = "AUV"
rule = "{rule}"
[sensors.gyro]
column = ["gx", "gy", "gz"]
unit = "deg/s"
frame = "FLU"
grade = "consumer"
[sensors.accelerometer]
column = ["fx", "fy", "fz"]
mounting = ["y", "-x", "z"]
lever_arm = [0.2, 0.0, 0.0]
grade = "consumer"
[sensors.magnetometer]
column = ["mx", "my", "mz"]
unit = "uT"
[sensors.dvl]
column = ["du", "dv", "dw"]
lever_arm = [0.4, 0.0, 0.1]
sigma = 0.02
[sensors.pressure]
column = "pressure"
unit = "dbar"
density = 1025.0
sigma = 500.0
[sensors.usbl]
column = ["east", "north", "up"]
frame = "ENU"
sigma = [0.5, 0.5, 0.5]
{more}
"""


class Truth:
    """Attitude, velocity and position by time, with exact derivatives of sums of sines."""

    def __init__(self, times):
        self.t = times
        wave = lambda size, rate, phase, order: size * rate**order * np.sin(rate * times + phase + order * np.pi / 2.0)
        angles = lambda order: np.stack(
            [
                wave(0.15, 0.9, 0.3, order),
                wave(0.2, 0.5, 1.0, order),
                wave(1.2, 0.25, 0.5, order) + [0.1 * times, np.full_like(times, 0.1)][order],
            ],
            axis=1,
        )
        self.angles, slopes = angles(0), angles(1)
        self.position, self.velocity, self.acceleration = (
            np.stack(
                [
                    wave(8.0, 0.2, 0.0, order) + wave(0.3, 1.1, 0.0, order),
                    wave(8.0, 0.15, 1.0, order),
                    wave(2.0, 0.3, 0.0, order),
                ],
                axis=1,
            )
            for order in (0, 1, 2)
        )
        self.R = Rotation.from_euler("ZYX", self.angles[:, ::-1])
        (roll, pitch, _), (p, q, r) = self.angles.T, slopes.T
        self.rate = np.stack(
            [
                p - np.sin(pitch) * r,
                np.cos(roll) * q + np.sin(roll) * np.cos(pitch) * r,
                -np.sin(roll) * q + np.cos(roll) * np.cos(pitch) * r,
            ],
            axis=1,
        )
        self.body_velocity = self.R.inv().apply(self.velocity)

    def turning(self, step=1e-4):
        """The rate's derivative, by differences of the closed form."""
        after, before = (Truth(self.t + sign * step).rate for sign in (1.0, -1.0))
        return (after - before) / (2.0 * step)


def columns(seed, times, delays=(), usbl=1.0, bias=True):
    """Truth and what sensors show, by column: biases of a consumer's grade, and noise as `SENSORS` states it.

    Pressure and DVL come at 5 Hz, the magnetometer at 10 Hz, USBL every `usbl` s; `delays` by sensor, s.
    """
    rng = np.random.default_rng(seed)
    fs, count = 1.0 / np.median(np.diff(times)), len(times)
    truth, late = Truth(times), dict(delays)
    at = lambda sensor: Truth(times - late.get(sensor, 0.0))
    white = lambda density: density * np.sqrt(fs) * rng.normal(size=(count, 3))
    gyro_bias, force_bias = np.radians(1.0) * rng.normal(size=3), 0.098 * rng.normal(size=3)
    matrix = np.eye(3) + 5e-3 * rng.normal(size=(3, 3))
    gyro = truth.rate @ matrix.T + gyro_bias + white(np.radians(0.01))
    arm = np.array([0.2, 0.0, 0.0])
    moved = np.cross(truth.turning(), arm) + np.cross(truth.rate, np.cross(truth.rate, arm))
    force = truth.R.inv().apply(truth.acceleration - GRAVITY) + moved + force_bias + white(0.01)
    field = at("magnetometer").R.inv().apply(FIELD + 0.03 * np.linalg.norm(FIELD) * rng.normal(size=(count, 3)))
    dvl = at("dvl").body_velocity + np.cross(at("dvl").rate, [0.4, 0.0, 0.1]) + 0.02 * rng.normal(size=(count, 3))
    depth = at("pressure").position[:, 2] + 500.0 / (1025.0 * 9.80665) * rng.normal(size=count)
    fix = at("usbl").position + 0.5 * rng.normal(size=(count, 3))
    every = lambda values, interval: np.where(np.arange(count) % round(interval * fs) == 0, values.T, np.nan)
    found = dict(zip(("gx", "gy", "gz"), (np.degrees(gyro) * [1.0, -1.0, -1.0]).T, strict=True))
    # the sensor's x axis points to the body's y, its y to the body's -x
    found |= {"fx": force[:, 1], "fy": -force[:, 0], "fz": force[:, 2]}
    found |= dict(zip(("mx", "my", "mz"), 1e6 * every(field, 0.1), strict=True))
    found |= dict(zip(("du", "dv", "dw"), every(dvl, 0.2), strict=True))
    found["pressure"] = every(1025.0 * 9.80665 * depth / 1e4, 0.2)
    north, east, down = every(fix, usbl)
    return truth, found | {"north": north, "east": east, "up": -down}
