"""Where a vehicle is and how it lies: attitude, position and strapdown filters, and streams that flight loops call."""

from .alignment import Alignment, MagneticField, aligned
from .attitude import Gyro, PaperAttitude, RotationAttitude
from .compiled_step import Program, ahead_of_time, native
from .constructed import (
    ConstructedAttitude,
    ConstructedAttitudeStream,
    Limits,
    constructed_attitude,
    constructed_over,
    standard_deviations,
)
from .navigator import FlightReading, Navigated, NavigatorState, PaperNavigator
from .position import Course, DeadReckoning
from .strapdown import Inertial, SensorNoise, StrapdownNavigation
from .stream import AbstractStream, Faults, Reading, Stream, StreamState, follow

__all__ = [
    "AbstractStream",
    "Alignment",
    "ConstructedAttitude",
    "ConstructedAttitudeStream",
    "Course",
    "DeadReckoning",
    "Faults",
    "FlightReading",
    "Gyro",
    "Inertial",
    "Limits",
    "MagneticField",
    "Navigated",
    "NavigatorState",
    "PaperAttitude",
    "PaperNavigator",
    "Program",
    "Reading",
    "RotationAttitude",
    "SensorNoise",
    "StrapdownNavigation",
    "Stream",
    "StreamState",
    "ahead_of_time",
    "aligned",
    "constructed_attitude",
    "constructed_over",
    "follow",
    "native",
    "standard_deviations",
]
