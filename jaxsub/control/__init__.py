"""Control: fins, autopilots, closed-loop flights, the paper's scenarios; the sampled plant, predictive control."""

from .autopilot import Autopilot, AutopilotMemory
from .bridge_casadi import casadi_jacobians, casadi_plant
from .bridge_control import control_system, state_space
from .closed_loop import fly
from .equilibrium import Trim, require_trim, trim
from .export import export_plant, export_plant_loader, load_plant
from .limits import FinLimits
from .linear import LinearPlant, linearisation_error, linearise, linearise_rates
from .mpc import Mpc, MpcPlan, Solved
from .observers import observer
from .plant import Plant, PlantJacobians, discretise
from .pursuit import Pursuit, pursue
from .scenarios import references, scenario_one, scenario_two
from .steering import CourseRate, Depth, Roll

__all__ = [
    "Autopilot",
    "AutopilotMemory",
    "CourseRate",
    "Depth",
    "FinLimits",
    "LinearPlant",
    "Mpc",
    "MpcPlan",
    "Plant",
    "PlantJacobians",
    "Pursuit",
    "Roll",
    "Solved",
    "Trim",
    "casadi_jacobians",
    "casadi_plant",
    "control_system",
    "discretise",
    "export_plant",
    "export_plant_loader",
    "fly",
    "linearisation_error",
    "linearise",
    "linearise_rates",
    "load_plant",
    "observer",
    "pursue",
    "references",
    "require_trim",
    "scenario_one",
    "scenario_two",
    "state_space",
    "trim",
]
