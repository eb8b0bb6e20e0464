"""Simulation: the sampled step, the continuous reference, and synthetic recordings."""

from .continuous import integrate
from .exponential import phi_functions, step_table
from .manoeuvres import doublet, prbs, square, three_two_one_one
from .sampled import Sampled, measure, sampled_states, simulate
from .step_derivatives import LinearisedStep, Slopes, linearised_step
from .synthesis import at_rest, synthetic
from .trajectory import Trajectory

__all__ = [
    "LinearisedStep",
    "Sampled",
    "Slopes",
    "Trajectory",
    "at_rest",
    "doublet",
    "integrate",
    "linearised_step",
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
