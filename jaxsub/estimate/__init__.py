"""Estimation: one `fit`, one `Fit`, and the methods that may do it."""

from .combined import Chain, Global
from .fit import Fit, channel_rms, evaluate, fit, information_matrix, output_errors, predict, search
from .method import AbstractMethod, Found, Iterative
from .methods import gauss_newton, gradient, nelder_mead, newton
from .problem import Expansion, Problem, initial_guess
from .starts import Basin, Rate, basins, scattered, success

__all__ = [
    "AbstractMethod",
    "Basin",
    "Chain",
    "Expansion",
    "Fit",
    "Found",
    "Global",
    "Iterative",
    "Problem",
    "Rate",
    "basins",
    "channel_rms",
    "evaluate",
    "fit",
    "gauss_newton",
    "gradient",
    "information_matrix",
    "initial_guess",
    "nelder_mead",
    "newton",
    "output_errors",
    "predict",
    "scattered",
    "search",
    "success",
]
