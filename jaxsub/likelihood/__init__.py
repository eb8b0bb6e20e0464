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
    padded_width,
    part_products,
    restricted,
    total_products,
    whitened,
)
from .initial_disturbance import Response, first_guess, response
from .innovation_products import part_length
from .innovations import FilteredRuns, filter_runs, forces_at_ends
from .open_loop import open_loop_errors
from .output_error import concentrated_sigma, errors, negative_log_likelihood, residual_outputs
from .readings import by_readings
from .run_shares import by_share, joined, share_of, shares
from .sensitivity import Jacobians, Linearised, force_columns, jacobians, linearise_runs, propagate
from .smoother import smoothed

__all__ = [
    "Averages",
    "BlockLinearised",
    "Columns",
    "Disturbance",
    "FilteredRuns",
    "Jacobians",
    "Linearised",
    "Response",
    "System",
    "by_readings",
    "by_share",
    "carried",
    "concentrated_sigma",
    "covariance_derivatives",
    "errors",
    "filter_runs",
    "first_guess",
    "force_columns",
    "forces_at_ends",
    "group_means",
    "jacobians",
    "joined",
    "linearise_runs",
    "negative_log_likelihood",
    "open_loop_errors",
    "output_errors",
    "padded_width",
    "part_length",
    "part_products",
    "propagate",
    "residual_outputs",
    "response",
    "restricted",
    "run_products",
    "share_of",
    "shares",
    "smoothed",
    "total_products",
    "whitened",
    "with_constants",
]
