"""Actuators of a body: thrusters, propellers, fins, rudders, ballast."""

from .base import Actuator, Actuators
from .read import KINDS, read_actuators
from .stages import stage_numbers
from .write import actuator_tables

__all__ = ["KINDS", "Actuator", "Actuators", "actuator_tables", "read_actuators", "stage_numbers"]
