"""Likelihoods: how probable a recording is under a model, and how that changes with everything in it."""

from .output_error import concentrated_sigma, errors, negative_log_likelihood, residual_outputs
from .sensitivity import Linearised, force_columns, linearise, propagate

__all__ = [
    "Linearised",
    "concentrated_sigma",
    "errors",
    "force_columns",
    "linearise",
    "negative_log_likelihood",
    "propagate",
    "residual_outputs",
]
