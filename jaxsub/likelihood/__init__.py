"""Likelihoods: probability density of a recording under a model, and its derivatives."""

from .averages import Averages, group_means
from .blocks import BlockLinearised, output_errors
from .by_run import run_products, with_constants
from .disturbance import (
    Columns,
    Disturbance,
    System,
    carried,
    covariance_derivatives,
    first_guess,
    padded_width,
    part_products,
    restricted,
    smoothed,
    total_products,
    whitened,
)
from .innovation_products import part_length
from .innovations import FilteredRuns, filter_runs
from .open_loop import open_loop_errors
from .output_error import concentrated_sigma, errors, negative_log_likelihood, residual_outputs
from .sensitivity import Jacobians, Linearised, force_columns, jacobians, linearise_runs, propagate

__all__ = [
    "Averages",
    "BlockLinearised",
    "Columns",
    "Disturbance",
    "FilteredRuns",
    "Jacobians",
    "Linearised",
    "System",
    "carried",
    "concentrated_sigma",
    "covariance_derivatives",
    "errors",
    "filter_runs",
    "first_guess",
    "force_columns",
    "group_means",
    "jacobians",
    "linearise_runs",
    "negative_log_likelihood",
    "open_loop_errors",
    "output_errors",
    "padded_width",
    "part_length",
    "part_products",
    "propagate",
    "residual_outputs",
    "restricted",
    "run_products",
    "smoothed",
    "total_products",
    "whitened",
    "with_constants",
]
