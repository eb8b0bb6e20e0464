"""Levenberg and Marquardt's method in NumPy, for peers that bring residuals and their derivatives only."""

import dataclasses
from collections.abc import Callable

import numpy as np

# cost, gradient (d,) and J^T J (d, d)
Expand = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]


@dataclasses.dataclass(frozen=True)
class End:
    """Where a search ended: coordinates, cost and evaluations."""

    z: np.ndarray
    cost: float
    evaluations: int


def minimise(expand: Expand, z: np.ndarray, tolerance: float = 1e-5, most: int = 60) -> End:
    """Damped Gauss-Newton steps (Nielsen 1999) until the full step promises to gain less than `tolerance`."""
    cost, gradient, curvature = expand(z)
    damping, growth = 1e-3, 2.0
    for count in range(1, most):
        if not np.isfinite(cost):
            return End(z, np.nan, count)
        diagonal = np.diag(np.maximum(np.diag(curvature), 1e-300))
        if 0.5 * gradient @ np.linalg.lstsq(curvature, gradient, rcond=1e-13)[0] <= tolerance or damping > 1e12:
            return End(z, cost, count)
        step = -np.linalg.solve(curvature + damping * diagonal, gradient)
        promised = -step @ (gradient + 0.5 * curvature @ step)
        new = expand(z + step)
        gain = (cost - new[0]) / promised
        if np.isfinite(new[0]) and np.isfinite(new[2]).all() and gain > 0.0:
            z, (cost, gradient, curvature) = z + step, new
            damping, growth = damping * max(1.0 / 3.0, 1.0 - (2.0 * min(gain, 1.0) - 1.0) ** 3), 2.0
        else:
            damping, growth = damping * growth, 2.0 * growth
    return End(z, cost, most)
