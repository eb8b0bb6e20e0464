"""Control: limits of the fins, autopilots, closed-loop flights, the paper's scenarios, and the plant for controllers."""

from .autopilot import Autopilot, Memory
from .closed_loop import fly
from .limits import FinLimits
from .linear import LinearPlant, linearisation_error, linearise, linearise_rates
from .plant import Jacobians, Plant, discretise
from .scenarios import references, scenario_one, scenario_two
from .steering import CourseRate, Depth, Roll
from .trim import Trim, require_trim, trim

__all__ = [
    "Autopilot",
    "CourseRate",
    "Depth",
    "FinLimits",
    "Jacobians",
    "LinearPlant",
    "Memory",
    "Plant",
    "Roll",
    "Trim",
    "discretise",
    "fly",
    "linearisation_error",
    "linearise",
    "linearise_rates",
    "references",
    "require_trim",
    "scenario_one",
    "scenario_two",
    "trim",
]
