"""Estimation: one `fit`, one `Solution`, and the methods that may do it."""

from .assessment import LEVEL, Assessment, ChannelResidual, assess, assess_residuals
from .batches import batch, side_by_side
from .between_runs import RunVariation, require_runs, unknown_spreads
from .combined import Chain, Global
from .disturbance import estimate_disturbance
from .filtered import Filtered
from .fitting import (
    AbstractSearchEnd,
    SearchEnd,
    Solution,
    channel_rms,
    evaluate,
    fit,
    information_matrix,
    race,
    search,
)
from .initial_states import initial_guess, rest, state_channels
from .integration_steps import substeps_for, substeps_unseen
from .method import AbstractMethod, Found, Iterative, Passes, by_cost, share_for, shares_at_once
from .methods import METHODS, ekf, gauss_newton, gradient, mekf, nelder_mead, newton, newton_eq10
from .posterior_draws import posterior
from .problem import Expansion, Problem, require_free
from .search_ends import Ends, ends
from .starts import MARGIN, Basin, Rate, basins, scattered, scattered_by_number, success

__all__ = [
    "LEVEL",
    "MARGIN",
    "METHODS",
    "AbstractMethod",
    "AbstractSearchEnd",
    "Assessment",
    "Basin",
    "Chain",
    "ChannelResidual",
    "Ends",
    "Expansion",
    "Filtered",
    "Found",
    "Global",
    "Iterative",
    "Passes",
    "Problem",
    "Rate",
    "RunVariation",
    "SearchEnd",
    "Solution",
    "assess",
    "assess_residuals",
    "basins",
    "batch",
    "by_cost",
    "channel_rms",
    "ekf",
    "ends",
    "estimate_disturbance",
    "evaluate",
    "fit",
    "gauss_newton",
    "gradient",
    "information_matrix",
    "initial_guess",
    "mekf",
    "nelder_mead",
    "newton",
    "newton_eq10",
    "posterior",
    "race",
    "require_free",
    "require_runs",
    "rest",
    "scattered",
    "scattered_by_number",
    "search",
    "share_for",
    "shares_at_once",
    "side_by_side",
    "state_channels",
    "substeps_for",
    "substeps_unseen",
    "success",
    "unknown_spreads",
]
