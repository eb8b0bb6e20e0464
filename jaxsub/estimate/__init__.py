"""Estimation: one `fit`, one `Solution`, and the methods that may do it."""

from .assessment import LEVEL, Assessment, ChannelResidual, assess, assess_residuals
from .batches import batch, side_by_side
from .between_runs import RunValues
from .combined import Chain, Global
from .coordinates import Coordinates, Expansion
from .dead_reckoning import Outage, Track, kinematic_filter, model_filter, tracks_of
from .disturbance import estimate_disturbance, estimate_disturbance_at_once
from .filtered import Filtered
from .fitting import AbstractSearchEnd, SearchEnd, Solution, channel_noise, channel_rms, evaluate, fit, search
from .initial_states import initial_guess, rest, state_channels
from .integration_steps import substeps_for, substeps_unseen
from .method import AbstractMethod, Found, Iterative, Passes, by_cost
from .methods import METHODS, ekf, gauss_newton, gradient, mekf, nelder_mead, newton, newton_eq10
from .path_disturbance import disturbance_along
from .posterior_draws import posterior
from .problem import Problem, require_free
from .restarted_searches import continued, race, with_estimated_spreads
from .search_ends import Ends, ends
from .starts import Basin, Rate, basins, scattered, success

__all__ = [
    "LEVEL",
    "METHODS",
    "AbstractMethod",
    "AbstractSearchEnd",
    "Assessment",
    "Basin",
    "Chain",
    "ChannelResidual",
    "Coordinates",
    "Ends",
    "Expansion",
    "Filtered",
    "Found",
    "Global",
    "Iterative",
    "Outage",
    "Passes",
    "Problem",
    "Rate",
    "RunValues",
    "SearchEnd",
    "Solution",
    "Track",
    "assess",
    "assess_residuals",
    "basins",
    "batch",
    "by_cost",
    "channel_noise",
    "channel_rms",
    "continued",
    "disturbance_along",
    "ekf",
    "ends",
    "estimate_disturbance",
    "estimate_disturbance_at_once",
    "evaluate",
    "fit",
    "gauss_newton",
    "gradient",
    "initial_guess",
    "kinematic_filter",
    "mekf",
    "model_filter",
    "nelder_mead",
    "newton",
    "newton_eq10",
    "posterior",
    "race",
    "require_free",
    "rest",
    "scattered",
    "search",
    "side_by_side",
    "state_channels",
    "substeps_for",
    "substeps_unseen",
    "success",
    "tracks_of",
    "with_estimated_spreads",
]
