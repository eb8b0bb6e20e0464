"""Filters: square-root Kalman algebra, extended Kalman filters on it, and the process noise that they share."""

from .consistent import ConsistentFuzzyNoise
from .defaults import state_scale, vehicle_filter
from .disturbed import DisturbedProcess, disturbed_filter
from .ekf import AbstractFilter, Estimate, ExtendedKalmanFilter, FilterState, on_line
from .form import AbstractForm, Covariance, SquareRoot
from .fuzzy import FuzzyNoise
from .gate import AbstractGate, InnovationGate, Open
from .kinematic import KinematicProcess
from .late import DelayedFilter, Late, Past
from .mekf import ModifiedKalmanFilter
from .model import AbstractProcess, Sample, linearised, select
from .noise import AbstractNoiseRule, ConstantNoise, Innovation, Residuals
from .passes import Identified, identify, over_runs
from .regression import FuzzyLine, fuzzy_line
from .rules import InnovationNoise, RandomNoise, SageHusaNoise
from .smoother import Smoothed, last, smooth_block
from .vehicle import Drive, VehicleProcess, samples

__all__ = [
    "AbstractFilter",
    "AbstractForm",
    "AbstractGate",
    "AbstractNoiseRule",
    "AbstractProcess",
    "ConsistentFuzzyNoise",
    "ConstantNoise",
    "Covariance",
    "DelayedFilter",
    "DisturbedProcess",
    "Drive",
    "Estimate",
    "ExtendedKalmanFilter",
    "FilterState",
    "FuzzyLine",
    "FuzzyNoise",
    "Identified",
    "Innovation",
    "InnovationGate",
    "InnovationNoise",
    "KinematicProcess",
    "Late",
    "ModifiedKalmanFilter",
    "Open",
    "Past",
    "RandomNoise",
    "Residuals",
    "SageHusaNoise",
    "Sample",
    "Smoothed",
    "SquareRoot",
    "VehicleProcess",
    "disturbed_filter",
    "fuzzy_line",
    "identify",
    "last",
    "linearised",
    "on_line",
    "over_runs",
    "samples",
    "select",
    "smooth_block",
    "state_scale",
    "vehicle_filter",
]
