"""Flights that several tests of control look at."""

import numpy as np

from jaxsub.control import Autopilot, fly
from jaxsub.effects import (
    EQUATIONS,
    CrossflowDrag,
    Current,
    FluidMemory,
    SensorBias,
    SensorDelay,
    SensorDrift,
    WaveForcing,
)
from jaxsub.effects.actuator_curves import ActuatorSaturation
from jaxsub.effects.actuators import ActuatorBacklash, ActuatorDelay, ActuatorLag, ActuatorRateLimit
from jaxsub.parameters import number
from jaxsub.simulation import at_rest
from jaxsub.vehicle import vehicle_from
from jaxsub.vehicle.catalogue import nps_auv_ii

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


def concealing():
    """The NPS AUV with an actuator that remembers and sensors that mislead."""
    vehicle = nps_auv_ii().with_effect(ActuatorLag("rudder", number(0.5)))
    return vehicle.with_effect(SensorBias("z", number(0.5))).with_effect(SensorDrift("r", number(1e-4)))


def remembering():
    """The NPS AUV with everything that carries something from sample to sample."""
    vehicle = nps_auv_ii()
    effects = [
        ActuatorSaturation("rudder", number(0.09)), ActuatorDelay("rudder", number(0.4)),
        ActuatorLag("rudder", number(0.5)), FluidMemory("sway", number(-200.0), number(1.5)),
        ActuatorRateLimit("elevator_right", number(0.2)), ActuatorBacklash("elevator_left", number(0.01)),
        SensorDelay("psi", number(0.6)), CrossflowDrag("horizontal", 5.3, 0.7, number(0.6)),
        WaveForcing("heave", number(40.0), number(10.0), number(0.9)), Current(EQUATIONS, number(0.2), number(-0.1)),
    ]  # fmt: skip
    for effect in effects:
        vehicle = vehicle.with_effect(effect)
    return vehicle
