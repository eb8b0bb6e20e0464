"""Likelihoods: how probable a recording is under a model, and how that changes with everything in it."""

from .disturbance import (
    Columns,
    Disturbance,
    System,
    carried,
    covariance_derivatives,
    first_guess,
    padded_width,
    part_products,
    products,
    restricted,
    smoothed,
    whitened,
)
from .innovations import Followed, follow
from .output_error import concentrated_sigma, errors, negative_log_likelihood, residual_outputs
from .sensitivity import Jacobians, Linearised, force_columns, jacobians, linearise, propagate

__all__ = [
    "Columns",
    "Disturbance",
    "Followed",
    "Jacobians",
    "Linearised",
    "System",
    "carried",
    "concentrated_sigma",
    "covariance_derivatives",
    "errors",
    "first_guess",
    "follow",
    "force_columns",
    "jacobians",
    "linearise",
    "negative_log_likelihood",
    "padded_width",
    "part_products",
    "products",
    "propagate",
    "residual_outputs",
    "restricted",
    "smoothed",
    "whitened",
]
