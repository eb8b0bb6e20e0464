"""The white part of residuals, and whether innovations are white."""

import numpy as np
from jaxtyping import Bool, Float
from scipy import special

# samples; each window is a test of its own
_LAGS = (5, 20, 60)


def record_sigma(error: Float[np.ndarray, "r k c"], mask: np.ndarray) -> Float[np.ndarray, " c"]:
    r"""The white part of each channel's residual $\sqrt{\tfrac12\langle(e_{k+1}-e_k)^2\rangle}$, SI (von Neumann)."""
    both = mask[:, 1:] & mask[:, :-1]
    squares = np.sum(np.where(both, np.diff(error, axis=1), 0.0) ** 2, axis=(0, 1))
    return np.sqrt(0.5 * squares / np.maximum(both.sum((0, 1)), 1))


def portmanteau(white: Float[np.ndarray, "r k c"], measured: Bool[np.ndarray, "r k c"]) -> float:
    r"""How probable correlations over time as large as those of `white` are where there are none.

    $Q = \sum_{l\le L} (\sum_k e_k e_{k+l})^2 / \sum_k e_k^2 e_{k+l}^2$ is $\chi^2_L$ for each channel of innovations,
    whatever their variance; the least over channels and windows L, corrected for their number.
    Source: Ljung and Box (1978), Biometrika 65; with the weights of Diebold (1986).
    """
    seen = np.where(measured, white, 0.0)
    longest = min(_LAGS[-1], seen.shape[1] // 4)
    terms = np.zeros((longest, seen.shape[2]))
    for lag in range(1, longest + 1):
        product = seen[:, lag:] * seen[:, :-lag]
        terms[lag - 1] = np.sum(product, axis=(0, 1)) ** 2 / np.maximum(np.sum(product**2, axis=(0, 1)), 1e-300)
    windows = [lags for lags in _LAGS if lags <= longest]
    least = [special.chdtrc(lags, terms[:lags].sum(axis=0)) for lags in windows]
    return min(1.0, float(np.min(least)) * len(windows) * seen.shape[2]) if windows else 1.0
