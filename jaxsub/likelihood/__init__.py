"""Likelihoods: probability density of a recording under a model, and its derivatives."""

from .averages import Averages, group_means
from .blocks import BlockLinearised, Watch, block_length, nobody, output_errors, summed_products
from .disturbance import (
    Adjoint,
    Columns,
    Disturbance,
    System,
    carried,
    carried_back,
    carried_to_start,
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
from .output_error import concentrated_sigma, errors, negative_log_likelihood, residual_outputs
from .sensitivity import Jacobians, Linearised, force_columns, jacobians, linearise_runs, propagate, value_and_columns

__all__ = [
    "Adjoint",
    "Averages",
    "BlockLinearised",
    "Columns",
    "Disturbance",
    "FilteredRuns",
    "Jacobians",
    "Linearised",
    "System",
    "Watch",
    "block_length",
    "carried",
    "carried_back",
    "carried_to_start",
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
    "nobody",
    "output_errors",
    "padded_width",
    "part_length",
    "part_products",
    "propagate",
    "residual_outputs",
    "restricted",
    "smoothed",
    "summed_products",
    "total_products",
    "value_and_columns",
    "whitened",
]
