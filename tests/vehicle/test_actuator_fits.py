"""Numbers of actuators are estimated with the coefficients, and what an actuator leaves out is named and written."""

import dataclasses
import tomllib

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import driven, stacked

from jaxsub.discrepancy import diagnose
from jaxsub.effects import ActuatorDelay, ActuatorLag, QuadraticDamping, SensorScale, ThrusterCrossCoupling
from jaxsub.estimate import fit
from jaxsub.simulation import synthetic
from jaxsub.vehicle import vehicle_from, vehicle_text, with_coefficients

PLACES = {"port": [-0.2, -0.15, 0.0], "starboard": [-0.2, 0.15, 0.0]}
VOCABULARY = (ActuatorLag, ActuatorDelay, QuadraticDamping, SensorScale, ThrusterCrossCoupling)


def twin(**changes):
    """Surge and yaw by two thrusters whose commands are volts."""
    common = {"kind": "thruster", "direction": [1.0, 0.0, 0.0], "forward": 0.8, "reverse": 0.6, "dead_band": 0.2}
    tree = {
        "schema": 1, "name": "twin", "kind": "submerged-body", "dof": ["surge", "yaw"],
        "body": {"mass": 20.0, "inertia": [0.5, 0.8, 0.9]}, "coefficients": {"X_u": -12.0, "N_r": -1.2},
        "inputs": {name: {"column": name, "unit": "V"} for name in PLACES},
        "actuators": {name: common | {"position": place} | changes.get(name, {}) for name, place in PLACES.items()},
        "outputs": {"u": {"sigma": 0.005}, "r": {"sigma": 0.005}},
    }  # fmt: skip
    return vehicle_from(tree, "twin.toml")


def recordings(vehicle, count=3):
    runs = [driven(vehicle, 0.1 * np.arange(200), seed, amplitude=3.0, hold=12) for seed in range(count)]
    grown = [np.linspace(0.3, 1.0, 200) * np.array([run.columns[name] for name in PLACES]) for run in runs]
    runs = [
        dataclasses.replace(run, columns=run.columns | dict(zip(PLACES, volts, strict=True)))
        for run, volts in zip(runs, grown, strict=True)
    ]
    return synthetic(vehicle, runs, seed=4)


def test_curve_and_lag_of_a_thruster_are_estimated_with_the_drag():
    """Claim: thrust coefficients astern and ahead, a tied one, a lag and the drag come back within four errors."""
    free = lambda value: {"value": value, "free": True}
    true = {"forward": 0.8, "reverse": 0.6, "time_constant": 0.3}
    begun = {"forward": free(0.6), "reverse": free(0.7), "time_constant": free(0.15)}
    truth, start = (twin(port=port, starboard={"forward": "port.forward"}) for port in (true, begun))
    start = start.with_values({"X_u": jnp.asarray(-9.0), "N_r": jnp.asarray(-1.0)})
    found = fit(start, stacked(start, recordings(truth, 2)))
    expected = {"port.forward": 0.8, "port.reverse": 0.6, "actuator-lag[port].T": 0.3, "X_u": -12.0, "N_r": -1.2}
    assert set(found.standard_errors) == set(expected)
    for name, value in expected.items():
        error = found.standard_errors[name]
        assert error < 0.1 * abs(value)
        assert abs(found.values[name] - value) < 4.0 * error, name
    assert float(found.vehicle.values()["starboard.forward"]) == float(found.values["port.forward"])


@pytest.mark.long
def test_lag_of_one_thruster_is_named_and_written_to_its_table():
    """Claim: of two thrusters the one that lags is named, and its improved file has the time constant."""
    truth = twin(starboard={"time_constant": 0.4})
    runs = recordings(truth)
    found, improved = diagnose(twin(), runs[:2], runs[2:], vocabulary=VOCABULARY)
    assert [(effect.effect, effect.equations) for effect in found.physics] == [("actuator-lag", ["input:starboard"])]
    tree = tomllib.loads(vehicle_text(with_coefficients(improved)))
    assert "effects" not in tree
    assert abs(tree["actuators"]["starboard"]["time_constant"]["value"] - 0.4) < 0.05
    assert "time_constant" not in tree["actuators"]["port"]
