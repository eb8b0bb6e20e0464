"""Estimation: one `fit`, one `Fit`."""

from .fit import Fit, channel_rms, evaluate, fit, information_matrix, output_errors, predict, search
from .problem import Problem, initial_guess

__all__ = [
    "Fit",
    "Problem",
    "channel_rms",
    "evaluate",
    "fit",
    "information_matrix",
    "initial_guess",
    "output_errors",
    "predict",
    "search",
]
