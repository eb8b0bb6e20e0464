"""Inputs of any name are judged by the unit of their vehicle file, and not as angles."""

import numpy as np

from jaxsub.checks import check
from jaxsub.checks.channels import channels_of
from jaxsub.recording import Recording
from jaxsub.vehicle import vehicle_from

THRUSTER = {"kind": "thruster", "position": [0.0, 0.0, 0.0], "direction": [1.0, 0.0, 0.0]}
TREE = {
    "schema": 1, "name": "ROV", "kind": "submerged-body", "dof": ["surge"],
    "body": {"mass": 20.0, "inertia": [1.0, 1.0, 1.0]}, "coefficients": {"X_u": -20.0, "B_surge_trim": 1.0},
    "inputs": {"bow": "f", "stern": {"column": "m", "unit": "V"}, "trim": "raw", "rudder": "delta"},
    "actuators": {"bow": THRUSTER, "stern": THRUSTER | {"gain": 3.0}}, "outputs": {"u": {"sigma": 0.01}},
}  # fmt: skip


def test_force_voltage_and_raw_counts_are_not_angles():
    """Claim: 40 N, 24 V and 1500 counts pass without a finding about their values; a rudder of 40 rad does not."""
    vehicle, t = vehicle_from(TREE, "rov.toml"), 0.1 * np.arange(200)
    assert [channel.unit for channel in channels_of(vehicle.layout)][:4] == ["N", "V", "", "rad"]
    wave = np.sin(t)
    columns = {"f": 40.0 * wave, "m": 24.0 * wave, "raw": 1500.0 + 400.0 * wave, "delta": 40.0 * wave, "u": 0.3 * wave}
    found = check(vehicle, [Recording("run", t, columns, "run.csv")]).findings
    assert [one.channel for one in found if one.check == "impossible-value"] == ["delta"]


def test_shaft_of_any_name_may_turn_as_fast_as_small_thrusters_do():
    """Claim: 3000 revolutions a minute are no finding for an input in rad/s; a rate of the hull of 300 rad/s is."""
    inputs = {name: {"column": name, "unit": "rad/s"} for name in ("left", "shaft_speed")}
    coefficients = {"X_u": -20.0, "B_surge_left": 1.0, "X_nn": 0.01}
    outputs = {"u": {"sigma": 0.01}, "r": {"sigma": 0.01}}
    more = {
        "inputs": inputs,
        "coefficients": coefficients,
        "outputs": outputs,
        "actuators": {},
        "dof": ["surge", "yaw"],
    }
    vehicle, wave = vehicle_from(TREE | more, "rov.toml"), np.sin(0.1 * np.arange(200))
    columns = {"left": 314.0 * wave, "shaft_speed": 314.0 * wave, "u": 0.3 * wave, "r": 314.0 * wave}
    found = check(vehicle, [Recording("run", 0.1 * np.arange(200), columns, "run.csv")]).findings
    assert [one.channel for one in found if one.check == "impossible-value"] == ["r"]
