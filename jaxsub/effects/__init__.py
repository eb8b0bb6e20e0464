"""The vocabulary of left-out physics: every effect that a diagnosis may name, a file or two a family."""

from .actuators import ActuatorDelay, ActuatorLag
from .base import (
    AbstractActuator,
    AbstractEffect,
    AbstractForce,
    AbstractSensor,
    admissible,
    amplitudes,
    number_fields,
    numbers,
    options,
    parameter_table,
    with_numbers,
)
from .hull import CoriolisCoupling, CrossflowDrag, HullAsymmetry, SpeedScaling, TurningSpeedLoss
from .hull_damping import CubicDamping, QuadraticDamping
from .hydrostatics import BuoyancyError, DensityStratification, HullCompressibility, ThermalExpansion, TrimOffset
from .mechanisms import CoulombFriction, CubicStiffness
from .motion import CHANNEL_UNITS, EQUATIONS, FORCES, GRAVITY, VELOCITIES, Facts, Motion, Signal
from .propulsion import PropellerTorque
from .sensors import SensorBias, SensorDrift, SensorScale

VOCABULARY: tuple[type[AbstractEffect], ...] = (
    QuadraticDamping,
    CubicDamping,
    CrossflowDrag,
    CoriolisCoupling,
    TurningSpeedLoss,
    SpeedScaling,
    HullAsymmetry,
    TrimOffset,
    BuoyancyError,
    HullCompressibility,
    DensityStratification,
    ThermalExpansion,
    PropellerTorque,
    ActuatorLag,
    ActuatorDelay,
    CoulombFriction,
    CubicStiffness,
    SensorBias,
    SensorScale,
    SensorDrift,
)


def candidates(facts: Facts, vocabulary: tuple[type[AbstractEffect], ...] = VOCABULARY) -> list[AbstractEffect]:
    """Every form of every effect that makes sense on a vehicle."""
    return [effect for kind in vocabulary for effect in kind.candidates(facts)]


__all__ = [
    "CHANNEL_UNITS",
    "EQUATIONS",
    "FORCES",
    "GRAVITY",
    "VELOCITIES",
    "VOCABULARY",
    "AbstractActuator",
    "AbstractEffect",
    "AbstractForce",
    "AbstractSensor",
    "Facts",
    "Motion",
    "Signal",
    "admissible",
    "amplitudes",
    "candidates",
    "number_fields",
    "numbers",
    "options",
    "parameter_table",
    "with_numbers",
]
