"""Filters: square-root Kalman algebra, extended Kalman filters on it, and the process noise that they share."""

from .defaults import state_scale, vehicle_filter
from .ekf import AbstractFilter, Estimate, ExtendedKalmanFilter, FilterState, on_line
from .form import AbstractForm, Covariance, SquareRoot
from .mekf import ModifiedKalmanFilter
from .model import AbstractProcess, Sample, linearised
from .noise import AbstractNoiseRule, ConstantNoise, Residuals
from .passes import Identified, identify, over_runs
from .vehicle import Drive, VehicleProcess, samples

__all__ = [
    "AbstractFilter",
    "AbstractForm",
    "AbstractNoiseRule",
    "AbstractProcess",
    "ConstantNoise",
    "Covariance",
    "Drive",
    "Estimate",
    "ExtendedKalmanFilter",
    "FilterState",
    "Identified",
    "ModifiedKalmanFilter",
    "Residuals",
    "Sample",
    "SquareRoot",
    "VehicleProcess",
    "identify",
    "linearised",
    "on_line",
    "over_runs",
    "samples",
    "state_scale",
    "vehicle_filter",
]
