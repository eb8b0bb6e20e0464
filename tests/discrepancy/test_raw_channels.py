"""Sensor effects are named through raw channels: by an output's own name, in the column's own form."""

import tomllib

import numpy as np
import pytest

from jaxsub.discrepancy import diagnose
from jaxsub.effects import (
    ActuatorLag,
    QuadraticDamping,
    SensorBias,
    SensorDelay,
    SensorLeverArm,
    SensorMisalignment,
    SensorScale,
)
from jaxsub.recording import Recording
from jaxsub.simulation import prbs, synthetic
from jaxsub.vehicle import vehicle_from

pytestmark = pytest.mark.long
KINDS = (ActuatorLag, QuadraticDamping, SensorBias, SensorDelay, SensorLeverArm, SensorMisalignment, SensorScale)
FILE = """
schema = 1
name = "AUV"
kind = "submerged-body"
dof = ["surge", "sway", "yaw"]
[body]
mass = 30.5
inertia = [0.18, 3.5, 3.5]
speed = 1.5
length = 1.33
diameter = 0.19
[coefficients]
X_udot = { value = -1.0, fixed = true }
X_u = -6.0
X_0 = 9.0
X_T = { value = 1.0, fixed = true }
Y_vdot = { value = -35.5, fixed = true }
N_rdot = { value = -4.88, fixed = true }
Y_v = -40.0
Y_r = 8.0
N_v = -4.0
N_r = -12.0
Y_delta_r = 20.0
N_delta_r = -14.0
[inputs]
rudder = "delta_r"
thrust = "T"
[outputs.gyro]
channel = "r"
column = "gyro_z"
frame = "FLU"
sigma = 0.003
offset = { value = 0.0, free = true, prior_std = 0.02 }
[outputs.dvl]
channel = ["u", "v"]
column = ["vx", "vy"]
lever_arm = [0.4, 0.0, 0.1]
sigma = 0.01
[outputs.compass]
channel = "psi"
column = "heading"
wrap = "0-360"
sigma = 0.01
"""
ASKEW = FILE.replace("lever_arm", f"mounting = [0.0, 0.0, {np.deg2rad(2.0)}]\nlever_arm")
LATE = FILE + '[[effects]]\neffect = "sensor-delay"\nchannel = "compass"\nparameters = { tau = 0.4 }\n'


def auv(text=FILE):
    return vehicle_from(tomllib.loads(text), "auv.toml")


@pytest.mark.parametrize(
    ("text", "label", "size"),
    [(ASKEW, "sensor-misalignment[dvl_u,dvl_v,dvl_v,dvl_u]", np.deg2rad(2.0)), (LATE, "sensor-delay[compass]", 0.4)],
)
def test_a_concealed_fault_of_a_sensor_is_named(text, label, size):
    """Claim: a log askew by 2° and a compass 0.4 s late are named alone, within three errors, and others not."""
    true = auv(text).with_values({"gyro.offset": np.asarray(0.01), "Y_v": np.asarray(-46.0)})
    times = 0.1 * np.arange(300)
    drives = [
        Recording(f"run{i}", times, {"delta_r": prbs(300, 12, 0.2, i), "T": prbs(300, 40, 4.0, i + 9)}, f"run{i}")
        for i in range(3)
    ]
    runs = synthetic(true, drives, seed=1)
    found, _ = diagnose(auv(), runs[:2], runs[2:], vocabulary=KINDS)
    assert (found.verdict, [one.label for one in found.physics]) == ("named", [label])
    (number,) = found.physics[0].parameters.values()
    assert abs(number.value - size) < 3.0 * number.standard_error
    held = found.fit["held_out"]
    assert max(held["improved"].values()) < 1.15 < max(held["baseline"].values())
