"""Simulation: the sampled step, the continuous reference, and synthetic recordings."""

from .continuous import integrate
from .exponential import phi_functions, step_table
from .manoeuvres import doublet, prbs, square, three_two_one_one
from .sampled import Sampled, measure, sampled_states, simulate
from .synthesis import at_rest, synthetic
from .trajectory import Trajectory

__all__ = [
    "Sampled",
    "Trajectory",
    "at_rest",
    "doublet",
    "integrate",
    "measure",
    "phi_functions",
    "prbs",
    "sampled_states",
    "simulate",
    "square",
    "step_table",
    "synthetic",
    "three_two_one_one",
]
