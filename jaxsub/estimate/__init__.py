"""Estimation: one `fit`, one `Fit`."""

from .fit import Fit, channel_rms, evaluate, fit, search
from .problem import Problem, initial_guess

__all__ = ["Fit", "Problem", "channel_rms", "evaluate", "fit", "initial_guess", "search"]
