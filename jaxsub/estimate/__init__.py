"""Estimation: one `fit`, one `Fit`, and the methods that may do it."""

from .combined import Chain, Global
from .disturbance import FROM_AFAR, FROM_NEAR, estimate_disturbance
from .filtered import Filtered
from .fit import Fit, channel_rms, evaluate, fit, information_matrix, output_errors, predict, search
from .method import AbstractMethod, Found, Iterative
from .methods import METHODS, ekf, gauss_newton, gradient, mekf, nelder_mead, newton, newton_eq10
from .problem import Expansion, Problem, initial_guess
from .starts import Basin, Rate, basins, scattered, success

__all__ = [
    "FROM_AFAR",
    "FROM_NEAR",
    "METHODS",
    "AbstractMethod",
    "Basin",
    "Chain",
    "Expansion",
    "Filtered",
    "Fit",
    "Found",
    "Global",
    "Iterative",
    "Problem",
    "Rate",
    "basins",
    "channel_rms",
    "ekf",
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
    "output_errors",
    "predict",
    "scattered",
    "search",
    "success",
]
