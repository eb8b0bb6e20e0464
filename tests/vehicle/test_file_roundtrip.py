"""A vehicle that is written and read again is the same: its values, names, freedoms, and every simulated output."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import coupled, driven, oscillator, stacked

from jaxsub.effects import (
    ActuatorDelay,
    ActuatorLag,
    CoriolisCoupling,
    CoulombFriction,
    CrossflowDrag,
    SensorBias,
    SpeedScaling,
    TrimOffset,
)
from jaxsub.simulation import at_rest, simulate
from jaxsub.vehicle import read_vehicle, vehicle_from, vehicle_text, write_vehicle
from jaxsub.vehicle.catalogue import dsrv, nps_auv_ii, remus_100


def glider():
    """Surge and heave under a recorded pitch, with ballast, water density and an accelerometer."""
    return vehicle_from(
        {
            "schema": 1, "name": 'a "glider" \\ №7', "kind": "submerged-body", "dof": ["surge", "heave"],
            "body": {"mass": 52.123456789012345, "weight": {"value": 511.0, "fixed": False, "prior_std": 0.5},
                     "speed": 0.3, "centre_of_buoyancy": [0.01, 0.0, -0.02], "reference_density": 1027.3,
                     "length": 1.23456789},
            "coefficients": {"X_u": {"value": -5.1, "bounds": [-10.0, 0.0]}, "Z_w": {"value": -80.0, "fixed": True},
                             "X_nn": 1e-3, "Z_0": {"value": 1.0, "bounds": [-math.inf, 3.0]}},
            "inputs": {"shaft_speed": "n", "thrust": "T"}, "prescribed": {"theta": "pitch", "q": "q"},
            "environment": {"density": "rho", "ballast": "V"},
            "outputs": {"u": {"sigma": 0.01}, "az": {"sigma": "estimate", "lever_arm": [0.1, 0.0, -0.2]}, "depth": {}},
        },
        "glider.toml",
    )  # fmt: skip


def improved():
    """The NPS vehicle with effects of every kind."""
    vehicle = nps_auv_ii()
    layout = vehicle.layout
    effects = [
        CrossflowDrag("horizontal", layout.length, layout.diameter, jnp.asarray(0.6)),
        CoriolisCoupling(layout.equations, jnp.asarray(1.0)),
        SpeedScaling("yaw", "rudder", jnp.asarray(-2000.0)),
        TrimOffset("y", jnp.asarray(0.002)),
        ActuatorLag("rudder", jnp.asarray(0.31)),
        ActuatorDelay("elevator_left", jnp.asarray(0.17)),
        SensorBias("r", jnp.asarray(1 / 3)),
    ]
    for effect in effects:
        vehicle = vehicle.with_effect(effect)
    return vehicle


def rubbing():
    """A mechanism with an effect of its own."""
    return oscillator().with_effect(CoulombFriction("x", 0.01, jnp.asarray(0.2), jnp.asarray(-0.03)))


VEHICLES = (nps_auv_ii, remus_100, dsrv, oscillator, coupled, glider, improved, rubbing)


@pytest.mark.parametrize("make", VEHICLES)
def test_written_vehicle_reads_back_the_same(make, tmp_path):
    vehicle = make()
    write_vehicle(vehicle, tmp_path / "vehicle.toml", comment="two\nlines")
    again = read_vehicle(tmp_path / "vehicle.toml")
    assert (tmp_path / "vehicle.toml").read_text().startswith("# two\n# lines\n")
    assert type(again) is type(vehicle)
    values = {name: float(value) for name, value in again.values().items()}
    assert values == {name: float(value) for name, value in vehicle.values().items()}
    # what is written is in SI, whatever system the file it is from has
    bare = lambda v: dataclasses.replace(v.layout, parameters=(), system="")
    assert bare(again) == bare(vehicle)
    # a row without a prior says nothing by its mean
    told = lambda v: {row.name: dataclasses.replace(row, prior_mean=0.0) for row in v.layout.parameters}
    fixed = {name for name, row in told(again).items() if not row.free}
    assert {n: r for n, r in told(again).items() if n not in fixed} == {
        r.name: told(vehicle)[r.name] for r in vehicle.layout.free
    }
    assert [effect.label for effect in again.effects] == [effect.label for effect in vehicle.effects]
    assert vehicle_text(again) == vehicle_text(vehicle)


@pytest.mark.parametrize("make", [glider, improved, rubbing])
def test_written_vehicle_answers_the_same(make, tmp_path):
    vehicle = make()
    write_vehicle(vehicle, tmp_path / "vehicle.toml")
    again = read_vehicle(tmp_path / "vehicle.toml")
    runs = stacked(vehicle, [driven(vehicle, 0.1 * np.arange(12), seed=1, hold=3)])
    outputs = [simulate(v, runs, at_rest(v, 1)) for v in (vehicle, again)]
    assert np.isfinite(outputs[0]).all()
    assert np.abs(outputs[0]).max() > 0.01
    np.testing.assert_array_equal(*outputs)
