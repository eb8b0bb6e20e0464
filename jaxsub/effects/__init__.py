"""The vocabulary of left-out physics: every effect that a diagnosis may name, a file or two a family."""

from .actuator_curves import ActuatorDeadband, ActuatorMisalignment, ActuatorSaturation, ControlSurfaceStall
from .actuators import ActuatorBacklash, ActuatorDelay, ActuatorLag, ActuatorRateLimit
from .base import (
    AbstractActuator,
    AbstractEffect,
    AbstractForce,
    AbstractSensor,
    admissible,
    amplitude,
    amplitudes,
    number_fields,
    numbers,
    options,
    parameter_table,
    shape,
    with_numbers,
)
from .boundaries import BottomSuction, FreeSurfaceSuction, TetherDrag
from .environment import Current, WaveForcing, wave_band
from .events import MassShift, ThrustLoss
from .hull import CoriolisCoupling, CrossflowDrag, HullAsymmetry, SpeedScaling, TurningSpeedLoss
from .hull_damping import CubicDamping, QuadraticDamping
from .hydrostatics import BuoyancyError, DensityStratification, HullCompressibility, ThermalExpansion, TrimOffset
from .mechanisms import CoulombFriction, CubicStiffness, Saturation
from .memory import AbstractMemory, FluidMemory, Hysteresis, with_memory
from .motion import (
    CHANNEL_UNITS,
    EQUATIONS,
    FORCES,
    GRAVITY,
    VELOCITIES,
    Facts,
    Motion,
    Signal,
    by_name,
    unit_per,
    velocities,
)
from .propulsion import PropellerAsymmetry, PropellerRace, PropellerTorque, ThrusterCrossCoupling
from .sensor_mounting import SensorLeverArm, SensorMisalignment
from .sensor_response import SensorDelay, SensorRectification, SensorSaturation
from .sensors import SensorBias, SensorDrift, SensorScale
from .smooth import KNOTS, SmoothForce, variables
from .vocabulary import VOCABULARY, candidates, from_script, looked_at, vocabulary

__all__ = [
    "CHANNEL_UNITS",
    "EQUATIONS",
    "FORCES",
    "GRAVITY",
    "KNOTS",
    "VELOCITIES",
    "VOCABULARY",
    "AbstractActuator",
    "AbstractEffect",
    "AbstractForce",
    "AbstractMemory",
    "AbstractSensor",
    "ActuatorBacklash",
    "ActuatorDeadband",
    "ActuatorDelay",
    "ActuatorLag",
    "ActuatorMisalignment",
    "ActuatorRateLimit",
    "ActuatorSaturation",
    "BottomSuction",
    "BuoyancyError",
    "ControlSurfaceStall",
    "CoriolisCoupling",
    "CoulombFriction",
    "CrossflowDrag",
    "CubicDamping",
    "CubicStiffness",
    "Current",
    "DensityStratification",
    "Facts",
    "FluidMemory",
    "FreeSurfaceSuction",
    "HullAsymmetry",
    "HullCompressibility",
    "Hysteresis",
    "MassShift",
    "Motion",
    "PropellerAsymmetry",
    "PropellerRace",
    "PropellerTorque",
    "QuadraticDamping",
    "Saturation",
    "SensorBias",
    "SensorDelay",
    "SensorDrift",
    "SensorLeverArm",
    "SensorMisalignment",
    "SensorRectification",
    "SensorSaturation",
    "SensorScale",
    "Signal",
    "SmoothForce",
    "SpeedScaling",
    "TetherDrag",
    "ThermalExpansion",
    "ThrustLoss",
    "ThrusterCrossCoupling",
    "TrimOffset",
    "TurningSpeedLoss",
    "WaveForcing",
    "admissible",
    "amplitude",
    "amplitudes",
    "by_name",
    "candidates",
    "from_script",
    "looked_at",
    "number_fields",
    "numbers",
    "options",
    "parameter_table",
    "shape",
    "unit_per",
    "variables",
    "velocities",
    "vocabulary",
    "wave_band",
    "with_memory",
    "with_numbers",
]
