"""The estimators by name: each a solver and what it is given. One object each, so that each is compiled for once."""

import functools

import optimistix as optx

from ..filter.ekf import ExtendedKalmanFilter
from ..filter.mekf import ModifiedKalmanFilter
from .blockwise import GaussNewton
from .combined import Chain
from .coordinates import Coordinates
from .damped import Damped
from .filtered import Filtered
from .method import Iterative
from .newton_raphson import NewtonEq10
from .problem import Problem
from .simplex import NelderMead


@functools.cache
def gauss_newton(tolerance: float = 1e-5) -> GaussNewton:
    """Gauss–Newton with the damping of Levenberg and Marquardt.

    It ends where a step promises to lower the cost by less than `tolerance`.
    """
    return GaussNewton(Damped(Problem.expand, tolerance, within=Coordinates.bounds), 60)


@functools.cache
def newton(tolerance: float = 1e-5) -> Iterative:
    """Damped Newton with the exact Hessian.

    It ends where a step promises to lower the cost by less than `tolerance`.
    """
    return Iterative(Damped(Problem.expand_exactly, tolerance, within=Coordinates.bounds), 60)


@functools.cache
def newton_eq10(tolerance: float = 1e-6) -> Iterative:
    """The paper's modified Newton–Raphson, eq. 10, with the exact Hessian and no safeguard.

    It ends where coordinates and cost change by less than `tolerance`, relative to themselves or to one.
    """
    return Iterative(NewtonEq10(rtol=tolerance, atol=tolerance), 200)


@functools.cache
def nelder_mead(tolerance: float = 1e-9) -> Iterative:
    """The paper's simplex search, section 4.2.

    It ends where the costs at the corners have an rms difference below `tolerance`, in the unit of J.
    """
    return Iterative(NelderMead(tolerance), 20_000)


@functools.cache
def gradient(tolerance: float = 1e-9) -> Iterative:
    """First derivatives alone: optax's L-BFGS.

    It ends where coordinates and cost change by less than `tolerance`, relative to themselves or to one.
    """
    import optax

    return Iterative(optx.OptaxMinimiser(optax.lbfgs(), rtol=tolerance, atol=tolerance), 500)


@functools.cache
def mekf() -> Filtered:
    """The paper's modified extended Kalman filter with square roots."""
    return Filtered(ModifiedKalmanFilter)


@functools.cache
def filtered_first() -> Chain:
    """The paper's modified filter, and Gauss–Newton from where it ends."""
    return Chain(mekf(), gauss_newton())


@functools.cache
def ekf() -> Filtered:
    """The plain extended Kalman filter of state and parameters."""
    return Filtered(ExtendedKalmanFilter)


METHODS = {
    "newton_eq10": newton_eq10,
    "newton": newton,
    "gauss_newton": gauss_newton,
    "nelder_mead": nelder_mead,
    "gradient": gradient,
    "ekf": ekf,
    "mekf": mekf,
}
