"""Flights that several tests of control look at."""

import numpy as np

from jaxsub.control import Autopilot, fly
from jaxsub.simulate import at_rest
from jaxsub.vehicle import vehicle_from

TIMES = 0.25 * np.arange(401)


def held(**values):
    """References that do not change over `TIMES`."""
    return {name: np.full(len(TIMES), value) for name, value in values.items()}


def flown(vehicle, reference, autopilot=None, **options):
    """A flight over `TIMES` without noise."""
    options = {"seed": 1, "noise": False} | options
    return fly(vehicle, autopilot or Autopilot.of(vehicle), reference, TIMES, **options)


def rolled(vehicle, angle):
    """Straight flight, rolled."""
    column = len(vehicle.layout.equations) + vehicle.layout.positions.index("phi")
    return at_rest(vehicle, 1)[0].at[column].set(angle)


def body(dof, coefficients, inputs, **more):
    """A submerged body of 100 kg at 2 m/s."""
    data = {
        "schema": 1, "name": "body", "kind": "submerged-body", "dof": dof,
        "body": {"mass": 100.0, "inertia": [5.0, 40.0, 50.0], "speed": 2.0},
        "coefficients": coefficients, "inputs": inputs, "outputs": {n: {"sigma": 0.01} for n in "rqpz"},
    }  # fmt: skip
    return vehicle_from(data | more, "body.toml")
