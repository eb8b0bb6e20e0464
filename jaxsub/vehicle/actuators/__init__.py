"""Actuators of a body: thrusters, propellers, fins, rudders, ballast."""

from .base import Actuator, Actuators
from .read import KINDS, read_actuators
from .stages import stage_numbers
from .surfaces import Rudder
from .write import actuator_tables

__all__ = ["KINDS", "Actuator", "Actuators", "Rudder", "actuator_tables", "read_actuators", "stage_numbers"]
