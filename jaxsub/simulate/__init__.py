"""Simulation: the sampled step, the continuous reference, and synthetic recordings."""

from .exponential import phi_functions, step_table
from .sampled import Sampled, measure, simulate

__all__ = ["Sampled", "measure", "phi_functions", "simulate", "step_table"]
