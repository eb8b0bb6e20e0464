"""Control: limits of the fins, autopilots, closed-loop flights and the paper's scenarios."""

from .autopilot import Autopilot, Memory
from .closed_loop import fly
from .limits import FinLimits
from .scenarios import references, scenario_one, scenario_two
from .steering import CourseRate, Depth, Roll

__all__ = [
    "Autopilot",
    "CourseRate",
    "Depth",
    "FinLimits",
    "Memory",
    "Roll",
    "fly",
    "references",
    "scenario_one",
    "scenario_two",
]
