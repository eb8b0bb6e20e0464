r"""A function of one variable of which nothing is known but that it is smooth, or how smooth.

It is drawn through `FINE` knots whose heights have a Gaussian prior before the data, of covariance
$s^2\exp(-\tfrac12(x_i-x_j)^2/\ell^2)$ with $\ell$ some share of the variable's range and $s$ where the evidence is
largest. So what a smooth function gains and what it costs is that of the few shapes that the data tell, however many
knots there are, and a function of many periods is found like one of a single bend. With the whitened products G of the
knots' hat functions among themselves, b of theirs with the residual, and $L L^T$ the covariance for s = 1, the log
evidence gained is

$$\tfrac12 \sum_i \Bigl[\frac{s^2 c_i^2}{1 + s^2\lambda_i} - \ln(1 + s^2\lambda_i)\Bigr],\qquad
L^T G L = U\lambda U^T,\; c = U^T L^T b.$$

Twice that is, where there is no such function, half of the time zero and otherwise $\chi^2_1$, or less.
Source: Rasmussen and Williams (2006), Gaussian Processes for Machine Learning; Self and Liang (1987), J. Am. Stat.
Assoc. 82, on the likelihood ratio of a variance at its bound.
"""

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...effects import KNOTS
from .. import settings
from ..linearise.products import Products
from .spline_basis import hat_functions

# three knots between any two of `SmoothForce`
FINE = 4 * (KNOTS - 1) + 1
# s² in units of the one for which the best identified shape has a prior as wide as its error
_SIZES = np.geomspace(1e-2, 1e8, 61)
_ROUNDING = 1e-8


class Smooth(NamedTuple):
    """The gain in log evidence of the most probable smooth function, and its columns as sums of hat functions.

    The columns' amplitudes are independent before the data, and worth one sample. (FINE, FINE). `size`: s, infinite
    where no such function gains.
    """

    gain: float
    weights: np.ndarray
    size: float


def smoothest(products: Products, chosen: Sequence[int], hats: Sequence[int], length: np.ndarray) -> Smooth:
    """The most probable smooth function beside the candidates `chosen`; its hat functions `hats` have these lengths."""
    G, b = products.remaining(chosen, hats)
    G, b = G * np.outer(length, length), b * length
    best = Smooth(0.0, np.zeros_like(G), math.inf)
    for L in _roots(settings.LENGTH_SCALES):
        values, U = np.linalg.eigh(L.T @ G @ L)
        values, c = np.maximum(values, 0.0), U.T @ (L.T @ b)
        sizes = _SIZES / max(float(values[-1]), 1e-300)
        spread = sizes[:, None] * values
        gains = 0.5 * np.sum(sizes[:, None] * c**2 / (1.0 + spread) - np.log1p(spread), axis=1)
        i = int(np.argmax(gains))
        if gains[i] > best.gain:
            weights = length[:, None] * L * np.sqrt(sizes[i] / products.samples)
            best = Smooth(float(gains[i]), weights, float(np.sqrt(sizes[i])))
    return best


@functools.cache
def _roots(scales: tuple[float, ...]) -> list[np.ndarray]:
    """A root of the covariance of the heights for each of some length scales."""
    apart = np.subtract.outer(np.arange(FINE), np.arange(FINE)) / (FINE - 1)
    covariances = [np.exp(-0.5 * (apart / scale) ** 2) + _ROUNDING * np.eye(FINE) for scale in scales]
    return [np.linalg.cholesky(covariance) for covariance in covariances]


def coarse() -> np.ndarray:
    """(FINE, KNOTS) the hat functions of `SmoothForce` in terms of the fine ones."""
    return hat_functions(np.linspace(0.0, 1.0, FINE), KNOTS)
